"""The horizon: the segment of the mission plan that a step re-solves, and its extension to rest for publication."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.boundary import BoundaryConditions
from mpc_cover.model.braking import braking_velocities
from mpc_cover.model.tolerances import STEP_ROUNDING
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.ocp import OCP

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.model.fleet_constraints import FleetConstraints


def optimised_steps(plan: Trajectory, fleet: FleetConstraints, horizon: int) -> int:
    """Return how many samples of the mission plan are optimised within a horizon [samples]; the rest is for braking."""
    if plan.steps <= horizon:
        return plan.steps
    braking_s = float((fleet.speed_max / fleet.input_max).max())
    return max(1, horizon - int(np.ceil(braking_s / plan.period - STEP_ROUNDING)))


def horizon_ocp(
    plan: Trajectory,
    fleet: FleetConstraints,
    cell: FloatArray,
    demand: tuple[FloatArray, IntArray | None],
    segment: int,
    steps: int,
    period: float | None = None,
) -> OCP:
    """Return the OCP whose solution replaces the first `segment` samples of the mission plan by `steps` samples.

    Its terminal state is that of the mission plan after the segment; at the end of the plan only the velocity is given.
    `demand` is the weights and looks (J, K) allocated to the segment on `cell` (K, d) [m]; looks None for one each.
    The `period` [s] of its samples is that of the plan, unless it is given.
    """
    last = segment == plan.steps
    ends = BoundaryConditions(
        start_position=plan.position[0],
        start_velocity=plan.velocity[0],
        end_position=None if last else plan.position[segment],
        end_velocity=plan.velocity[segment],
    )
    weight, looks = demand
    return OCP(fleet, cell, weight, steps, period or plan.period, ends, looks)


def spliced(plan: Trajectory, velocity: FloatArray, segment: int) -> Trajectory:
    """Return the mission plan with its samples up to `segment` replaced by `velocity` (n+1, m, d) [m/s]."""
    later = np.concatenate([velocity[1:], plan.velocity[segment + 1 :]])
    return _from_start(plan, later)


def ended_at_rest(plan: Trajectory, fleet: FleetConstraints, horizon: int) -> Iterator[Trajectory]:
    """Yield initial segments of the mission plan, extended to rest within a horizon [samples], the longest first."""
    later = plan.velocity[1:]
    if plan.steps <= horizon:
        rest = np.zeros((horizon - plan.steps, *later.shape[1:]))
        yield _from_start(plan, np.concatenate([later, rest]))
        return
    for kept in range(optimised_steps(plan, fleet, horizon), 0, -1):
        braking = braking_velocities(later[kept - 1], fleet, plan.period)
        padding = horizon - kept - braking.shape[0]
        if padding >= 0:
            rest = np.zeros((padding, *later.shape[1:]))
            yield _from_start(plan, np.concatenate([later[:kept], braking, rest]))


def _from_start(plan: Trajectory, later: FloatArray) -> Trajectory:
    """Return the motion from the plan's initial state with velocities `later` (N, m, d) [m/s] at samples 1 to N."""
    return Trajectory.from_velocities(plan.position[0], plan.velocity[0], later, plan.start_time, plan.period)
