"""Collision avoidance and connectivity of double integrators: every agent always remains able to stop.

The argument, for agents that choose an input at the same instants, hold it for T_s, and receive each other's state:

1. An agent brakes with the constant force -v / (s T_s), s = ceil(|v| / (u_max T_s)): within u_max, it is at rest
   after s samples. Its path is a segment from q to q + s T_s v / 2; its stopping ball has the segment as diameter.
   After a sample of braking the rest of the segment is left, whose ball lies in the ball before.
2. From the stopping balls of now each pair agrees on convex sets, one for each, that hold the balls (`safe_sets`).
   The filter admits an input only if the stopping ball after it lies in the agent's set. Braking always does.
3. The parabola flown meanwhile lies in the triangle of q, q + v T_s / 2 and the next q (its Bezier points). The
   first two lie in the ball of now, as v T_s / 2 is no longer than the segment, the third in the next ball. All
   three are in the set, which is convex; so is the path.
4. So the next balls satisfy the pairs' bounds again, and, by induction, all agents keep rho_B from each other at every
   instant, and edges that both ends keep stay within rho_C. Edges are those whose two balls fit into a ball of
   diameter rho_C, which is the weight they are chosen by: the current tree exists at the next sample, too.

Nothing here depends on what the others choose within their sets, nor on when. An agent that has not received a
neighbour's state of this instant brakes: the neighbour's current set leaves room for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.distributed.single_integrator_filter import fan

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.distributed.safe_sets import SafeSets

LESS = 1.0 - 1e-9
"""Forces and speeds are kept this much below their bounds, for rounding."""
_BETWEEN = (0.75, 0.5, 0.25)
"""How far from braking towards the wanted force, when the whole of it is not safe."""
_FORCES = (1.0, 0.5)
"""Lengths of the fan's forces, as parts of u_max."""


@dataclass(frozen=True, eq=False)
class StoppingBall:
    """Where an agent is, or will be if it brakes.

    Attributes
    ----------
    centre : (..., d) [m].
    radius : (...) [m].
    stop : (..., d) where it comes to rest [m].
    force : (..., d) the constant force that brakes [m/s^2].
    """

    centre: FloatArray
    radius: FloatArray
    stop: FloatArray
    force: FloatArray


def stopping_balls(position: FloatArray, velocity: FloatArray, input_max: FloatArray, period: float) -> StoppingBall:
    """Return the stopping balls of (m, ..., d) positions [m] and velocities [m/s] with (m,) u_max [m/s^2]."""
    speed = np.linalg.norm(velocity, axis=-1)
    slower = (LESS * period * input_max).reshape(-1, *[1] * (speed.ndim - 1))
    samples = np.maximum(np.ceil(speed / slower - 1e-9), 1.0)
    half = velocity * (0.25 * period * samples)[..., None]
    force = -velocity / (period * samples)[..., None]
    return StoppingBall(position + half, 0.25 * period * samples * speed, position + 2.0 * half, force)


def track(
    velocity: FloatArray, desired: FloatArray, input_max: FloatArray, speed_max: FloatArray, period: float
) -> FloatArray:
    """Return inputs (m, d) [m/s^2], held for `period` [s], that bring (m, d) velocities [m/s] nearest to those desired.

    The desired velocity is cut to v_max and the input to u_max (3.11, 3.12), both (m,): the speed at the end of the
    period is within v_max when it is at the start, as any point between the two is.
    """
    force = (limited(desired, speed_max) - velocity) / period
    return limited(force, input_max)


def limited(vector: FloatArray, longest: FloatArray) -> FloatArray:
    """Return (m, ..., d) vectors cut to (m,) lengths (5.2)."""
    length = np.linalg.norm(vector, axis=-1)
    bound = longest.reshape(-1, *[1] * (length.ndim - 1))
    scale = np.divide(bound, length, out=np.ones_like(length), where=length > bound)
    return np.asarray(vector * scale[..., None])


def filter_forces(
    position: FloatArray,
    velocity: FloatArray,
    force: FloatArray,
    limits: tuple[FloatArray, FloatArray],
    sets: SafeSets,
    period: float,
) -> tuple[FloatArray, BoolArray]:
    """Return the (m, d) inputs [m/s^2] nearest to those wanted that are safe, and (m,) which agents only brake.

    Parameters
    ----------
    position, velocity : (m, d) [m], [m/s].
    force : (m, d) wanted, within u_max [m/s^2].
    limits : (m,) u_max [m/s^2] and (m,) v_max [m/s].
    sets : safe sets of the current stopping balls.
    period : T_s [s].
    """
    input_max, speed_max = limits
    brake = stopping_balls(position, velocity, input_max, period).force
    candidate = _candidates(velocity, force, brake, limits, period)
    after = velocity[:, None] + period * candidate
    moved = position[:, None] + period * velocity[:, None] + 0.5 * period**2 * candidate
    ball = stopping_balls(moved, after, input_max, period)
    fits = np.linalg.norm(after, axis=2) <= speed_max[:, None]
    safe = fits & sets.in_box(moved) & sets.in_box(ball.stop) & sets.holds(ball.centre, ball.radius)
    miss = np.where(safe, np.linalg.norm(candidate - force[:, None], axis=2), np.inf)
    best = np.argmin(miss, axis=1)
    row = np.arange(len(force))
    stuck = np.isinf(miss[row, best])
    return np.where(stuck[:, None], brake, candidate[row, best]), stuck


def _candidates(
    velocity: FloatArray,
    force: FloatArray,
    brake: FloatArray,
    limits: tuple[FloatArray, FloatArray],
    period: float,
) -> FloatArray:
    """Return (m, n, d) forces within u_max after which the speed is within v_max, the wanted one first."""
    input_max, speed_max = limits
    fixed = fan(force.shape[1])
    strength = np.array(_FORCES)[:, None] * LESS * input_max[:, None, None]
    wide = (strength[..., None] * fixed).reshape(len(force), -1, force.shape[1])
    part = np.array([1.0, *_BETWEEN])[:, None]
    between = brake[:, None] + part * (force - brake)[:, None]
    every = np.concatenate([between, np.zeros_like(force)[:, None], wide], axis=1)
    # the nearest velocity within v_max is no farther from the current velocity, which is within v_max
    after = limited(velocity[:, None] + period * every, LESS * speed_max)
    return np.asarray((after - velocity[:, None]) / period)
