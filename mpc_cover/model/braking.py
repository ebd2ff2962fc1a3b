"""Straight-line braking at the input limit: what an agent without a plan does, and the fallback of last resort."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.tolerances import AT_REST, DIVISOR_MIN, STEP_ROUNDING
from mpc_cover.model.trajectory import Trajectory

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.fleet import Fleet

_INPUT_SHARE = 1.0 - 1e-9
"""Part of u_max that sampled braking uses, so that rounding cannot exceed the limit; a plain choice."""


def braking_position(
    position: FloatArray, velocity: FloatArray, later: FloatArray, input_max: FloatArray
) -> FloatArray:
    """Return positions (G, C, d) [m] at times `later` (G,) [s] after braking starts.

    `position`, `velocity` are the (C, d) [m], [m/s] states at which it starts; `input_max` (C,) [m/s^2].
    """
    speed = np.linalg.norm(velocity, axis=1)
    time = np.minimum(later[:, None], (speed / input_max)[None])
    effective_time = time - 0.5 * time**2 * input_max / np.maximum(speed, AT_REST)
    return np.asarray(position[None] + effective_time[:, :, None] * velocity[None])


def braking_distance_gradient(
    normal: FloatArray, velocity: FloatArray, later: FloatArray, input_max: FloatArray
) -> FloatArray:
    """Return the gradient (C, d) [s] of the braking distance along `normal` (C, d) by the velocity (C, d) [m/s].

    The distance is that covered within `later` (C,) [s]; inf for the whole stopping distance. `input_max` (C,) [m/s^2].
    """
    speed = np.maximum(np.linalg.norm(velocity, axis=1), AT_REST)
    heading = velocity / speed[:, None]
    along = np.einsum("cd,cd->c", normal, heading)[:, None] * heading
    time, stops_in = later[:, None], (speed / input_max)[:, None]
    braked_for = np.minimum(time, stops_in)
    moving = braked_for * normal - braked_for**2 / (2.0 * stops_in) * (normal - along)
    stopped = 0.5 * stops_in * (normal + along)
    return np.asarray(np.where(time < stops_in, moving, stopped))


def braking_velocities(velocity: FloatArray, fleet: Fleet, period: float) -> FloatArray:
    """Return velocities (B, m, d) [m/s] at samples 1 to B of straight braking from (m, d) [m/s] to rest; B >= 1."""
    speed = np.linalg.norm(velocity, axis=1)
    decrease = fleet.input_max * period * _INPUT_SHARE
    count = max(1, int(np.ceil((speed / decrease).max() - STEP_ROUNDING)))
    share = np.maximum(speed[None] - np.arange(1, count + 1)[:, None] * decrease[None], 0.0)
    share /= np.maximum(speed, DIVISOR_MIN)[None]
    share[-1] = 0.0
    return np.asarray(share[:, :, None] * velocity[None])


def braking_trajectory(
    position: FloatArray, velocity: FloatArray, fleet: Fleet, start_time: float, period: float, steps: int
) -> Trajectory:
    """Return the motion that brakes straight from a (m, d) state [m], [m/s] to rest, of at least `steps` steps."""
    braking = braking_velocities(velocity, fleet, period)
    rest = np.zeros((max(0, steps - braking.shape[0]), *velocity.shape))
    later = np.concatenate([braking, rest])
    return Trajectory.from_velocities(position, velocity, later, start_time, period)
