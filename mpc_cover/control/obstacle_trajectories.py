"""The path of a plan among agents that are lost: until they come to rest they are obstacles that move."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.verification.path import Path

if TYPE_CHECKING:
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory

_SAME_TIME = 1e-9


def path_among(plan: Trajectory, state: FleetState) -> Path:
    """Return a plan's path in which the lost are where the state says, whatever the plan says of them."""
    time = plan.time
    moving = {index: course for index, course in state.obstacles.items() if course.end_time > time[0] + _SAME_TIME}
    if not moving:
        position, velocity, force = plan.position, plan.velocity, plan.input
        if state.lost.any():
            position, velocity, force = position.copy(), velocity.copy(), force.copy()
            position[:, state.lost] = state.position[state.lost]
            velocity[:, state.lost] = force[:, state.lost] = 0.0
        return Path(time, position, velocity, force)
    inner = np.unique(np.concatenate([course.time for course in moving.values()]))
    inner = inner[(inner > time[0]) & (inner < time[-1])]
    near = np.abs(time[:, None] - inner).min(axis=0) <= _SAME_TIME
    every = np.sort(np.concatenate([time, inner[~near]]))
    position, velocity = plan.at(every, _SAME_TIME)
    force = plan.input_at(every, _SAME_TIME)
    position[:, state.lost] = state.position[state.lost]
    velocity[:, state.lost] = force[:, state.lost] = 0.0
    for index, course in moving.items():
        position[:, index], velocity[:, index] = course.at(every, _SAME_TIME)
        force[:, index] = course.input_at(every, _SAME_TIME)
    return Path(every, position, velocity, force[:-1])
