"""The horizon: the segment of the mission plan that a step re-solves, and how what is published ends at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.boundary import Ends
from mpc_cover.model.braking import braking_velocities
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.ocp import OCP

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission


def resolved_steps(plan: Trajectory, mission: Mission) -> int:
    """Return how many samples of the mission plan the horizon re-solves; what is left of it is for braking."""
    horizon, fleet = mission.spec.control.horizon_steps, mission.fleet
    if plan.steps <= horizon:
        return plan.steps
    slowest = float((fleet.speed_max / fleet.input_max).max())
    return max(1, horizon - int(np.ceil(slowest / plan.period - 1e-9)))


def horizon_ocp(plan: Trajectory, mission: Mission, weight: FloatArray, segment: int, steps: int) -> OCP:
    """Return the window that replaces the first `segment` samples of the mission plan by `steps` ones.

    It must end where the rest of the mission plan goes on, unless there is no rest. `weight` (J, K) is what
    the segment has to cover.
    """
    last = segment == plan.steps
    ends = Ends(
        start_position=plan.position[0],
        start_velocity=plan.velocity[0],
        end_position=None if last else plan.position[segment],
        end_velocity=plan.velocity[segment],
    )
    return OCP(mission.fleet, mission.field.cell, weight, steps, plan.period, ends)


def spliced(plan: Trajectory, velocity: FloatArray, segment: int) -> Trajectory:
    """Return the mission plan with its samples up to `segment` replaced by `velocity` (n+1, m, d) [m/s]."""
    later = np.concatenate([velocity[1:], plan.velocity[segment + 1 :]])
    return _from_start(plan, later)


def ended_at_rest(plan: Trajectory, mission: Mission) -> Iterator[Trajectory]:
    """Yield beginnings of the mission plan that end at rest within the horizon, the longest first."""
    horizon = mission.spec.control.horizon_steps
    later = plan.velocity[1:]
    if plan.steps <= horizon:
        rest = np.zeros((horizon - plan.steps, *later.shape[1:]))
        yield _from_start(plan, np.concatenate([later, rest]))
        return
    for kept in range(resolved_steps(plan, mission), 0, -1):
        braking = braking_velocities(later[kept - 1], mission.fleet, plan.period)
        room = horizon - kept - braking.shape[0]
        if room >= 0:
            rest = np.zeros((room, *later.shape[1:]))
            yield _from_start(plan, np.concatenate([later[:kept], braking, rest]))


def _from_start(plan: Trajectory, later: FloatArray) -> Trajectory:
    """Return the motion from where the mission plan starts, with velocities `later` (N, m, d) [m/s] after that."""
    return Trajectory.from_velocities(plan.position[0], plan.velocity[0], later, plan.start_time, plan.period)
