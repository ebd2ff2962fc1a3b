"""Room to stop: whoever dies or falters is not run into by those who hear of it a little later.

An agent that dies brakes as hard as it can. The others fly on along the plan until one begins that knows of it, and
can brake then. That motion, for every agent and every period in which it may stop, keeps rho_B, too: the reaction
time of a driver, in the terms of 4.18.

Plans begin at samples. With a reaction time of R periods, whoever dies up to ceil(R) - R periods after a sample is
known of one sample sooner than who dies after that: both are the worst of their kind, and looked at in each period.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mpc_cover.constraints.box_overshoot import box_overshoot
from mpc_cover.constraints.pairs import all_pairs
from mpc_cover.constraints.rows import elastic_rows
from mpc_cover.model.braking import braking_distance_gradient, braking_position

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.constraints.rows import Layout, Rows
    from mpc_cover.model.fleet_constraints import FleetConstraints

_LOOKS = 4
"""Instants in a period at which distances are looked at."""
_SPARE = 0.02
"""Asked for on top of rho_B, for what lies between those instants [m]."""
_STANDING = 1e-9


class StopInstant(NamedTuple):
    """When in a period someone dies: `part` of it after a sample; the others fly on until `lag` samples after that."""

    lag: int
    part: float


@dataclass(frozen=True, eq=False)
class BrakingEncounters:
    """Encounters: case c is that `stopper` brakes a `moment` after `sample`, and `follower` comes nearest `later`.

    Attributes
    ----------
    moment : of the death.
    sample, stopper, follower : (C,).
    later : (C,) [s].
    apart : (C, d) follower minus stopper then [m].
    distance : (C,) its length [m].
    required : (C,) what is asked of it [m].
    """

    moment: StopInstant
    sample: IntArray
    stopper: IntArray
    follower: IntArray
    later: FloatArray
    apart: FloatArray
    distance: FloatArray
    required: FloatArray

    @property
    def excess(self) -> FloatArray:
        """(C,) by how much they come too near [m]."""
        return np.maximum(self.required - self.distance, 0.0)


def stop_instants(reaction: float) -> list[StopInstant]:
    """Return the worst moments to die at, for others who fly on for at most `reaction` periods."""
    lag = int(np.ceil(reaction - _STANDING))
    part = lag - reaction
    if lag == 0:
        return []
    return [StopInstant(lag, 0.0)] if part < _STANDING else [StopInstant(lag, part), StopInstant(lag - 1, 0.0)]


def braking_encounters(
    position: FloatArray,
    velocity: FloatArray,
    period: float,
    fleet: FleetConstraints,
    moment: StopInstant,
    reach: float = 0.0,
) -> BrakingEncounters:
    """Return the encounters of a motion (N+1, m, d) [m], [m/s] that are too near, or nearer than `reach` more [m].

    A motion that does not end at rest says nothing of what comes after it: its last samples are left out.
    """
    lag, part = moment
    last = velocity.shape[0] - (lag + 1 if velocity[-1].any() else 1)
    if fleet.size == 1 or fleet.separation_min <= 0.0 or last <= 0:
        return _none(moment, fleet.dimension)
    one, two = all_pairs(fleet.size)
    stopper, follower = np.concatenate([one, two]), np.concatenate([two, one])
    asked = np.tile(fleet.separations + _SPARE, 2)
    asked = np.where(fleet.is_active[stopper] & fleet.is_active[follower], asked, 0.0)
    place, speed = _within((position, velocity), last, part, period)
    bound = _at_least((position, velocity), (place, speed), period, fleet, lag)[:, stopper, follower]
    sample, case = np.nonzero((asked > 0.0) & (bound < asked + reach))
    if sample.size == 0:
        return _none(moment, fleet.dimension)
    stopper, follower, asked = stopper[case], follower[case], asked[case]
    braking_s = float((np.linalg.norm(velocity, axis=2) / fleet.input_max).max())
    count = int(np.ceil((lag + braking_s / period) * _LOOKS)) + 1
    later = np.arange(count, dtype=np.float64) * (period / _LOOKS)
    stopped = braking_position(place[sample, stopper], speed[sample, stopper], later, fleet.input_max[stopper])
    moved = _flown_on((position, velocity), sample, follower, later + part * period, period, fleet, lag)
    apart = moved - stopped  # (G, C, d)
    distance = np.linalg.norm(apart, axis=2)
    nearest, each = distance.argmin(axis=0), np.arange(sample.size)
    # who is too near already is the matter of whoever brought it about
    asked, distance = np.minimum(asked, distance[0]), distance[nearest, each]
    near = distance < asked + reach
    apart = apart[nearest, each][near]
    who, when = (stopper[near], follower[near]), later[nearest[near]]
    return BrakingEncounters(moment, sample[near], *who, when, apart, distance[near], asked[near])


def braking_violations(
    position: FloatArray, velocity: FloatArray, period: float, fleet: FleetConstraints
) -> FloatArray:
    """Return by how much [m] those who stop without warning are run into, or leave the box; 0 or more of them."""
    if fleet.reaction_periods == 0:
        return np.zeros(0)
    met = [
        braking_encounters(position, velocity, period, fleet, moment).excess
        for moment in stop_instants(fleet.reaction_periods)
    ]
    return np.concatenate([*met, box_overshoot(position, velocity, fleet).ravel()])


def braking_violation(position: FloatArray, velocity: FloatArray, period: float, fleet: FleetConstraints) -> float:
    """Return the largest of the braking violations [m]; 0 for none."""
    return float(braking_violations(position, velocity, period, fleet).max(initial=0.0))


def passive_safety_rows(
    layout: Layout,
    position: FloatArray,
    velocity: FloatArray,
    period: float,
    fleet: FleetConstraints,
    found: BrakingEncounters,
) -> Rows:
    """Return nbar . (q_follower - q_stopper) >= required at the instants that are worst at the iterate (N+1, m, d).

    Both are linear in positions and velocities but for the way that braking takes, which is linearised.
    """
    part, sample, normal = found.moment.part, found.sample, _directions(found)
    own, after, past, flies = _stage(found, period, layout.steps)
    square = past[:, None] ** 2 / (2.0 * period)
    u_max = fleet.input_max
    brakes = braking_distance_gradient(normal, velocity[own, found.follower], past, u_max[found.follower])
    _, speed = _within((position, velocity), layout.steps, part, period)
    stopped = braking_distance_gradient(normal, speed[sample, found.stopper], found.later, u_max[found.stopper])
    half = 0.5 * part**2 * period
    parts = [
        (layout.position(own, found.follower), normal),
        (layout.velocity(own, found.follower), np.where(flies[:, None], (past[:, None] - square) * normal, brakes)),
        (layout.velocity(after, found.follower), np.where(flies[:, None], square * normal, 0.0)),
        (layout.position(sample, found.stopper), -normal),
        (layout.velocity(sample, found.stopper), -(part * period - half) * normal - (1.0 - part) * stopped),
        (layout.velocity(sample + 1, found.stopper), -half * normal - part * stopped),
    ]
    axes = np.arange(layout.dimension)
    column = np.concatenate([begin[:, None] + axes for begin, _ in parts], axis=1)
    value = np.concatenate([slope for _, slope in parts], axis=1)
    iterate = np.concatenate([position.ravel(), velocity.ravel()])
    reached = np.einsum("ce,ce->c", value, iterate[column])
    along = np.einsum("cd,cd->c", normal, found.apart)
    return elastic_rows(column, -value, along - reached - found.required)


def _directions(found: BrakingEncounters) -> FloatArray:
    """Return unit vectors (C, d) from stopper to follower at their nearest; any where they meet."""
    aside = np.eye(found.apart.shape[1])[0]
    apart = found.distance[:, None]
    return np.where(apart > _STANDING, found.apart / np.maximum(apart, _STANDING), aside)


def _within(
    motion: tuple[FloatArray, FloatArray], count: int, part: float, period: float
) -> tuple[FloatArray, FloatArray]:
    """Return positions [m] and velocities [m/s], (count, m, d), a part of a period after each of the first samples."""
    position, velocity = motion
    speed = velocity[:count]
    gain = part * (velocity[1 : count + 1] - speed)
    return position[:count] + part * period * (speed + 0.5 * gain), speed + gain


def _stage(found: BrakingEncounters, period: float, steps: int) -> tuple[IntArray, IntArray, FloatArray, BoolArray]:
    """Return the follower's sample before the encounter, the next one, the time since [s], and if it flies on then."""
    lag, part = found.moment
    elapsed = found.later + part * period
    whole = np.minimum(np.floor(elapsed / period + _STANDING).astype(np.intp), lag)
    own = np.minimum(found.sample + whole, steps)
    return own, np.minimum(own + 1, steps), elapsed - whole * period, whole < lag


def _at_least(
    motion: tuple[FloatArray, FloatArray],
    dying: tuple[FloatArray, FloatArray],
    period: float,
    fleet: FleetConstraints,
    lag: int,
) -> FloatArray:
    """Return bounds (n, stopper, follower) from below on how near they come [m]."""
    position, speed = motion[0], np.linalg.norm(motion[1], axis=2)
    place, pace = dying[0], np.linalg.norm(dying[1], axis=2)
    after = np.minimum(np.arange(place.shape[0])[:, None] + np.arange(lag + 1), speed.shape[0] - 1)
    away = place[:, None, :, None] - position[after][:, :, None]  # (n, 0..r, stopper, follower, d)
    nearest = np.sqrt((away**2).sum(axis=4).min(axis=1))
    stopping, halting = pace**2 / (2.0 * fleet.input_max), speed[after[:, -1]] ** 2 / (2.0 * fleet.input_max)
    between = np.maximum(0.5 * period * speed[after].max(axis=1), halting)
    return np.asarray(nearest - between[:, None, :] - stopping[:, :, None])


def _flown_on(
    motion: tuple[FloatArray, FloatArray],
    sample: IntArray,
    agent: IntArray,
    elapsed: FloatArray,
    period: float,
    fleet: FleetConstraints,
    lag: int,
) -> FloatArray:
    """Return where (G, C, d) [m] agents are `elapsed` (G,) [s] after samples (C,): on the plan, then braking."""
    position, velocity = motion
    final = velocity.shape[0] - 1
    whole = np.floor(elapsed / period + _STANDING).astype(np.intp)
    flies = whole < lag
    own = np.minimum(sample + whole[flies, None], final)
    past = (elapsed[flies] - whole[flies] * period)[:, None, None]
    speed = velocity[own, agent]
    gain = velocity[np.minimum(own + 1, final), agent] - speed
    flown = position[own, agent] + past * speed + past**2 / (2.0 * period) * gain
    end = np.minimum(sample + lag, final)
    since = elapsed[~flies] - lag * period
    halted = braking_position(position[end, agent], velocity[end, agent], since, fleet.input_max[agent])
    return np.concatenate([flown, halted])


def _none(moment: StopInstant, dimension: int) -> BrakingEncounters:
    number, length = np.zeros(0, dtype=np.intp), np.zeros(0)
    return BrakingEncounters(moment, number, number, number, length, np.zeros((0, dimension)), length, length)
