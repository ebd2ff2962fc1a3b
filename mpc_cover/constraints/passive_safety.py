"""Passive safety: an agent that stops without warning is not hit, although the others react only after a delay.

The stopping agent ("stopper") brakes straight at its input limit. Each other agent ("follower") continues on the plan
until the first plan that takes the stop into account begins, and can brake then. The two motions, for every agent and
every period in which it may stop, keep rho_B as well: a driver's reaction time, in the terms of (4.18).

Plans begin at samples. With a reaction time of R periods, the reaction to a stop up to ceil(R) - R periods after a
sample begins one sample earlier than that to a later one. The worst instants of both kinds are checked in each period.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mpc_cover.constraints.box_overshoot import box_overshoot
from mpc_cover.constraints.pairs import all_pairs
from mpc_cover.constraints.rows import elastic_rows
from mpc_cover.model.braking import braking_distance_gradient, braking_position
from mpc_cover.model.tolerances import NO_DIRECTION, STEP_ROUNDING

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.constraints.rows import Layout, Rows
    from mpc_cover.model.fleet_constraints import FleetConstraints

_INSTANTS = 4
"""Instants per period at which distances are checked; a plain choice."""
_MARGIN = 0.02
"""Margin on rho_B [m] between those instants; a plain choice, more than `planning.scp.BRAKING_TOLERANCE`."""


class StopInstant(NamedTuple):
    """A stop `part` of a period after a sample; followers stay on the plan until `lag` samples after that sample."""

    lag: int
    part: float


@dataclass(frozen=True, eq=False)
class BrakingEncounters:
    """Closest approaches: in case c the `stopper` brakes a `moment` after `sample`; the `follower` is nearest `later`.

    Attributes
    ----------
    moment : instant of stopping within a period, the same for all cases.
    sample, stopper, follower : (C,) indices.
    later : (C,) time from the stop to the closest approach [s].
    offset : (C, d) position of the follower minus that of the stopper then [m].
    distance : (C,) its length [m].
    required : (C,) required distance [m].
    """

    moment: StopInstant
    sample: IntArray
    stopper: IntArray
    follower: IntArray
    later: FloatArray
    offset: FloatArray
    distance: FloatArray
    required: FloatArray

    @property
    def excess(self) -> FloatArray:
        """(C,) violation of the required distance [m]."""
        return np.maximum(self.required - self.distance, 0.0)


def stop_instants(reaction: float) -> list[StopInstant]:
    """Return the worst instants of stopping when followers react within `reaction` periods."""
    lag = int(np.ceil(reaction - STEP_ROUNDING))
    part = lag - reaction
    if lag == 0:
        return []
    return [StopInstant(lag, 0.0)] if part < STEP_ROUNDING else [StopInstant(lag, part), StopInstant(lag - 1, 0.0)]


def braking_separations(fleet: FleetConstraints) -> FloatArray:
    """Return the (pairs,) distances [m] that braking agents and followers keep, with a margin; 0 for lost agents."""
    one, two = all_pairs(fleet.size)
    return np.where(fleet.is_active[one] & fleet.is_active[two], fleet.separations + _MARGIN, 0.0)


def braking_encounters(
    position: FloatArray,
    velocity: FloatArray,
    period: float,
    fleet: FleetConstraints,
    moment: StopInstant,
    reach: float = 0.0,
) -> BrakingEncounters:
    """Return the closest approaches of a motion (N+1, m, d) [m], [m/s] that lie within `reach` [m] of a violation.

    If the motion does not end at rest, what follows it is unknown, and its last samples are left out.
    """
    lag, part = moment
    last = velocity.shape[0] - (lag + 1 if velocity[-1].any() else 1)
    if fleet.size == 1 or fleet.separation_min <= 0.0 or last <= 0:
        return _none(moment, fleet.dimension)
    one, two = all_pairs(fleet.size)
    stopper, follower = np.concatenate([one, two]), np.concatenate([two, one])
    required = np.tile(braking_separations(fleet), 2)
    place, speed = _within((position, velocity), last, part, period)
    bound = _distance_bounds((position, velocity), (place, speed), period, fleet, lag)[:, stopper, follower]
    sample, case = np.nonzero((required > 0.0) & (bound < required + reach))
    if sample.size == 0:
        return _none(moment, fleet.dimension)
    stopper, follower, required = stopper[case], follower[case], required[case]
    braking_s = float((np.linalg.norm(velocity, axis=2) / fleet.input_max).max())
    count = int(np.ceil((lag + braking_s / period) * _INSTANTS)) + 1
    later = np.arange(count, dtype=np.float64) * (period / _INSTANTS)
    stopped = braking_position(place[sample, stopper], speed[sample, stopper], later, fleet.input_max[stopper])
    moved = _follower_position((position, velocity), sample, follower, later + part * period, period, fleet, lag)
    offset = moved - stopped  # (G, C, d)
    distance = np.linalg.norm(offset, axis=2)
    nearest, each = distance.argmin(axis=0), np.arange(sample.size)
    # a pair that is too near when the stop begins violates separation (4.18), not passive safety
    required, distance = np.minimum(required, distance[0]), distance[nearest, each]
    near = distance < required + reach
    offset = offset[nearest, each][near]
    pair, when = (stopper[near], follower[near]), later[nearest[near]]
    return BrakingEncounters(moment, sample[near], *pair, when, offset, distance[near], required[near])


def braking_violations(
    position: FloatArray, velocity: FloatArray, period: float, fleet: FleetConstraints
) -> FloatArray:
    """Return all violations of passive safety [m], flat: of separation from braking agents, and box overshoots."""
    if fleet.reaction_periods == 0:
        return np.zeros(0)
    excess = [
        braking_encounters(position, velocity, period, fleet, moment).excess
        for moment in stop_instants(fleet.reaction_periods)
    ]
    return np.concatenate([*excess, box_overshoot(position, velocity, fleet).ravel()])


def braking_violation(position: FloatArray, velocity: FloatArray, period: float, fleet: FleetConstraints) -> float:
    """Return the largest violation of passive safety [m]; 0 for none."""
    return float(braking_violations(position, velocity, period, fleet).max(initial=0.0))


def passive_safety_rows(
    layout: Layout,
    position: FloatArray,
    velocity: FloatArray,
    period: float,
    fleet: FleetConstraints,
    found: BrakingEncounters,
) -> Rows:
    """Return elastic rows nbar . (q_follower - q_stopper) >= required at the closest approaches of the iterate.

    `position`, `velocity` are the iterate (N+1, m, d) [m], [m/s]. Both agents' positions are linear in it but for the
    braking distance, which is linearised.
    """
    part, sample, normal = found.moment.part, found.sample, _directions(found)
    own, after, past, on_plan = _stage(found, period, layout.steps)
    square = past[:, None] ** 2 / (2.0 * period)
    u_max = fleet.input_max
    brakes = braking_distance_gradient(normal, velocity[own, found.follower], past, u_max[found.follower])
    _, speed = _within((position, velocity), layout.steps, part, period)
    stopped = braking_distance_gradient(normal, speed[sample, found.stopper], found.later, u_max[found.stopper])
    half = 0.5 * part**2 * period
    parts = [
        (layout.position(own, found.follower), normal),
        (layout.velocity(own, found.follower), np.where(on_plan[:, None], (past[:, None] - square) * normal, brakes)),
        (layout.velocity(after, found.follower), np.where(on_plan[:, None], square * normal, 0.0)),
        (layout.position(sample, found.stopper), -normal),
        (layout.velocity(sample, found.stopper), -(part * period - half) * normal - (1.0 - part) * stopped),
        (layout.velocity(sample + 1, found.stopper), -half * normal - part * stopped),
    ]
    axes = np.arange(layout.dimension)
    column = np.concatenate([begin[:, None] + axes for begin, _ in parts], axis=1)
    value = np.concatenate([slope for _, slope in parts], axis=1)
    iterate = np.concatenate([position.ravel(), velocity.ravel()])
    reached = np.einsum("ce,ce->c", value, iterate[column])
    along = np.einsum("cd,cd->c", normal, found.offset)
    return elastic_rows(column, -value, along - reached - found.required)


def _directions(found: BrakingEncounters) -> FloatArray:
    """Return unit vectors (C, d) from stopper to follower at the closest approach; arbitrary where they coincide."""
    arbitrary = np.eye(found.offset.shape[1])[0]
    distance = found.distance[:, None]
    return np.where(distance > NO_DIRECTION, found.offset / np.maximum(distance, NO_DIRECTION), arbitrary)


def _within(
    motion: tuple[FloatArray, FloatArray], count: int, part: float, period: float
) -> tuple[FloatArray, FloatArray]:
    """Return positions [m] and velocities [m/s], (count, m, d), `part` of a period after each of the first samples."""
    position, velocity = motion
    speed = velocity[:count]
    gain = part * (velocity[1 : count + 1] - speed)
    return position[:count] + part * period * (speed + 0.5 * gain), speed + gain


def _stage(found: BrakingEncounters, period: float, steps: int) -> tuple[IntArray, IntArray, FloatArray, BoolArray]:
    """Return the follower's sample before the approach, the next, the time since [s], and whether it is on its plan."""
    lag, part = found.moment
    elapsed = found.later + part * period
    whole = np.minimum(np.floor(elapsed / period + STEP_ROUNDING).astype(np.intp), lag)
    own = np.minimum(found.sample + whole, steps)
    return own, np.minimum(own + 1, steps), elapsed - whole * period, whole < lag


def _distance_bounds(
    motion: tuple[FloatArray, FloatArray],
    stopping: tuple[FloatArray, FloatArray],
    period: float,
    fleet: FleetConstraints,
    lag: int,
) -> FloatArray:
    """Return lower bounds (n, stopper, follower) on the distances at closest approach [m]."""
    position, speed = motion[0], np.linalg.norm(motion[1], axis=2)
    place, initial_speed = stopping[0], np.linalg.norm(stopping[1], axis=2)
    after = np.minimum(np.arange(place.shape[0])[:, None] + np.arange(lag + 1), speed.shape[0] - 1)
    away = place[:, None, :, None] - position[after][:, :, None]  # (n, 0..r, stopper, follower, d)
    nearest = np.sqrt((away**2).sum(axis=4).min(axis=1))
    stopper_distance = initial_speed**2 / (2.0 * fleet.input_max)
    follower_distance = speed[after[:, -1]] ** 2 / (2.0 * fleet.input_max)
    between = np.maximum(0.5 * period * speed[after].max(axis=1), follower_distance)
    return np.asarray(nearest - between[:, None, :] - stopper_distance[:, :, None])


def _follower_position(
    motion: tuple[FloatArray, FloatArray],
    sample: IntArray,
    agent: IntArray,
    elapsed: FloatArray,
    period: float,
    fleet: FleetConstraints,
    lag: int,
) -> FloatArray:
    """Return positions (G, C, d) [m] `elapsed` (G,) [s] after samples (C,): `lag` periods on the plan, then braking."""
    position, velocity = motion
    final = velocity.shape[0] - 1
    whole = np.floor(elapsed / period + STEP_ROUNDING).astype(np.intp)
    on_plan = whole < lag
    own = np.minimum(sample + whole[on_plan, None], final)
    past = (elapsed[on_plan] - whole[on_plan] * period)[:, None, None]
    speed = velocity[own, agent]
    gain = velocity[np.minimum(own + 1, final), agent] - speed
    planned = position[own, agent] + past * speed + past**2 / (2.0 * period) * gain
    end = np.minimum(sample + lag, final)
    since = elapsed[~on_plan] - lag * period
    braking = braking_position(position[end, agent], velocity[end, agent], since, fleet.input_max[agent])
    return np.concatenate([planned, braking])


def _none(moment: StopInstant, dimension: int) -> BrakingEncounters:
    number, length = np.zeros(0, dtype=np.intp), np.zeros(0)
    return BrakingEncounters(moment, number, number, number, length, np.zeros((0, dimension)), length, length)
