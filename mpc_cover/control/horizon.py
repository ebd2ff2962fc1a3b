"""Cutting stretches out of the mission plan, splicing them in, and ending them at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.boundary import Ends
from mpc_cover.model.braking import braking_velocities
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.ocp import OCP

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission


def resolved_steps(whole: Trajectory, mission: Mission) -> int:
    """Return how many samples of the mission plan the horizon re-solves; what is left of it is for braking."""
    horizon, fleet = mission.spec.control.horizon_steps, mission.fleet
    if whole.steps <= horizon:
        return whole.steps
    slowest = float((fleet.speed_max / fleet.input_max).max())
    return max(1, horizon - int(np.ceil(slowest / whole.period - 1e-9)))


def horizon_ocp(whole: Trajectory, mission: Mission, weight: FloatArray, stretch: int, steps: int) -> OCP:
    """Return the window that replaces the first `stretch` samples of the mission plan by `steps` ones.

    It must end where the rest of the mission plan goes on, unless there is no rest. `weight` (J, K) is what
    the stretch has to cover.
    """
    last = stretch == whole.steps
    ends = Ends(
        start_position=whole.position[0],
        start_velocity=whole.velocity[0],
        end_position=None if last else whole.position[stretch],
        end_velocity=whole.velocity[stretch],
    )
    return OCP(mission.fleet, mission.field.cell, weight, steps, whole.period, ends)


def spliced(whole: Trajectory, velocity: FloatArray, stretch: int) -> Trajectory:
    """Return the mission plan with its samples up to `stretch` replaced by `velocity` (n+1, m, d) [m/s]."""
    later = np.concatenate([velocity[1:], whole.velocity[stretch + 1 :]])
    return Trajectory.from_velocities(whole.position[0], whole.velocity[0], later, whole.start_time, whole.period)


def ended_at_rest(whole: Trajectory, mission: Mission) -> Iterator[Trajectory]:
    """Yield beginnings of the mission plan that end at rest within the horizon, the longest first."""
    horizon = mission.spec.control.horizon_steps
    start, later = FleetState(whole.position[0], whole.velocity[0], whole.start_time), whole.velocity[1:]
    if whole.steps <= horizon:
        rest = np.zeros((horizon - whole.steps, *later.shape[1:]))
        yield start.trajectory(np.concatenate([later, rest]), whole.period)
        return
    for kept in range(resolved_steps(whole, mission), 0, -1):
        braking = braking_velocities(later[kept - 1], mission.fleet, whole.period)
        room = horizon - kept - braking.shape[0]
        if room >= 0:
            rest = np.zeros((room, *later.shape[1:]))
            yield start.trajectory(np.concatenate([later[:kept], braking, rest]), whole.period)
