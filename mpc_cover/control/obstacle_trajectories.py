"""Moving obstacles: the path of a plan for the verifier, with lost agents on their way to rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.verification.path import Path

if TYPE_CHECKING:
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory

_SAME_TIME_S = 1e-9
"""Samples of the plan and of obstacles closer than this are merged [s]; a plain choice."""


def path_among(plan: Trajectory, state: FleetState) -> Path:
    """Return a plan's path in which lost agents follow their obstacle trajectories instead of the plan."""
    time = plan.time
    begin = time[0] + _SAME_TIME_S
    moving = {index: obstacle for index, obstacle in state.obstacles.items() if obstacle.end_time > begin}
    if not moving:
        position, velocity, force = plan.position, plan.velocity, plan.input
        if state.lost.any():
            position, velocity, force = position.copy(), velocity.copy(), force.copy()
            position[:, state.lost] = state.position[state.lost]
            velocity[:, state.lost] = force[:, state.lost] = 0.0
        return Path(time, position, velocity, force)
    inner = np.unique(np.concatenate([obstacle.time for obstacle in moving.values()]))
    inner = inner[(inner > time[0]) & (inner < time[-1])]
    near = np.abs(time[:, None] - inner).min(axis=0) <= _SAME_TIME_S
    every = np.sort(np.concatenate([time, inner[~near]]))
    position, velocity = plan.at(every, _SAME_TIME_S)
    force = plan.input_at(every, _SAME_TIME_S)
    position[:, state.lost] = state.position[state.lost]
    velocity[:, state.lost] = force[:, state.lost] = 0.0
    for index, obstacle in moving.items():
        position[:, index], velocity[:, index] = obstacle.at(every, _SAME_TIME_S)
        force[:, index] = obstacle.input_at(every, _SAME_TIME_S)
    return Path(every, position, velocity, force[:-1])
