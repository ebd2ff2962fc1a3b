"""The horizon: the segment of the mission plan that a step re-solves, and how what is published ends at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.boundary import BoundaryConditions
from mpc_cover.model.braking import braking_velocities
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.ocp import OCP

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.model.fleet_constraints import FleetConstraints


def optimised_steps(plan: Trajectory, fleet: FleetConstraints, horizon: int) -> int:
    """Return how many samples of the mission plan are re-solved within a horizon [samples]; the rest is for braking."""
    if plan.steps <= horizon:
        return plan.steps
    slowest = float((fleet.speed_max / fleet.input_max).max())
    return max(1, horizon - int(np.ceil(slowest / plan.period - 1e-9)))


def horizon_ocp(
    plan: Trajectory,
    fleet: FleetConstraints,
    cell: FloatArray,
    owed: tuple[FloatArray, IntArray | None],
    segment: int,
    steps: int,
) -> OCP:
    """Return the problem whose motion replaces the first `segment` samples of the mission plan by `steps` ones.

    It must end where the rest of the mission plan goes on, unless there is no rest. `owed` is the weights and
    looks (J, K) that the segment has to bring on `cell` (K, d) [m]; looks None for one each.
    """
    last = segment == plan.steps
    ends = BoundaryConditions(
        start_position=plan.position[0],
        start_velocity=plan.velocity[0],
        end_position=None if last else plan.position[segment],
        end_velocity=plan.velocity[segment],
    )
    weight, looks = owed
    return OCP(fleet, cell, weight, steps, plan.period, ends, looks)


def spliced(plan: Trajectory, velocity: FloatArray, segment: int) -> Trajectory:
    """Return the mission plan with its samples up to `segment` replaced by `velocity` (n+1, m, d) [m/s]."""
    later = np.concatenate([velocity[1:], plan.velocity[segment + 1 :]])
    return _from_start(plan, later)


def ended_at_rest(plan: Trajectory, fleet: FleetConstraints, horizon: int) -> Iterator[Trajectory]:
    """Yield beginnings of the mission plan that end at rest within a horizon [samples], the longest first."""
    later = plan.velocity[1:]
    if plan.steps <= horizon:
        rest = np.zeros((horizon - plan.steps, *later.shape[1:]))
        yield _from_start(plan, np.concatenate([later, rest]))
        return
    for kept in range(optimised_steps(plan, fleet, horizon), 0, -1):
        braking = braking_velocities(later[kept - 1], fleet, plan.period)
        room = horizon - kept - braking.shape[0]
        if room >= 0:
            rest = np.zeros((room, *later.shape[1:]))
            yield _from_start(plan, np.concatenate([later[:kept], braking, rest]))


def _from_start(plan: Trajectory, later: FloatArray) -> Trajectory:
    """Return the motion from where the mission plan starts, with velocities `later` (N, m, d) [m/s] after that."""
    return Trajectory.from_velocities(plan.position[0], plan.velocity[0], later, plan.start_time, plan.period)
