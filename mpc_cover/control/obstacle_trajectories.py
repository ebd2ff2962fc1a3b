"""How those who are lost come to rest: until then they are obstacles that move."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.verification.path import Path

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mpc_cover.model.trajectory import Trajectory

_SAME_TIME = 1e-9


def path_among(plan: Trajectory, obstacles: Mapping[int, Trajectory]) -> Path:
    """Return a plan's path in which moving obstacles, by number, fly theirs; rows in the plan say where they end."""
    time = plan.time
    moving = {index: course for index, course in obstacles.items() if course.end_time > time[0] + _SAME_TIME}
    if not moving:
        return Path(time, plan.position, plan.velocity, plan.input)
    inner = np.unique(np.concatenate([course.time for course in moving.values()]))
    inner = inner[(inner > time[0]) & (inner < time[-1])]
    near = np.abs(time[:, None] - inner).min(axis=0) <= _SAME_TIME
    every = np.sort(np.concatenate([time, inner[~near]]))
    position, velocity = plan.at(every, _SAME_TIME)
    force = plan.input_at(every, _SAME_TIME)
    for index, course in moving.items():
        (position[:, index], velocity[:, index]), force[:, index] = (
            course.at(every, _SAME_TIME),
            course.input_at(every, _SAME_TIME),
        )
    return Path(every, position, velocity, force[:-1])
