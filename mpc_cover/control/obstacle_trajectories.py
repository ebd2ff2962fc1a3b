"""How those who are lost come to rest: until then they are obstacles that move."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.verification.path import Path

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mpc_cover.arrays import FloatArray
    from mpc_cover.model.trajectory import Plan

_SAME_TIME = 1e-9


@dataclass(frozen=True, eq=False)
class ObstacleTrajectory:
    """One agent's motion to its rest, piece by piece; row r holds from `time[r]` to `time[r + 1]`.

    Attributes
    ----------
    time : (R,) mission time [s], R >= 1; at rest from the last on.
    position, velocity, input : (R, d) [m], [m/s], [m/s^2].
    """

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    input: FloatArray

    def at(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return position, velocity and input (T, d) at and right after mission times (T,) [s]."""
        row = np.clip(np.searchsorted(self.time, time + _SAME_TIME, side="right") - 1, 0, len(self.time) - 1)
        elapsed = np.maximum(time - self.time[row], 0.0)[:, None]
        force, velocity = self.input[row], self.velocity[row]
        position = self.position[row] + elapsed * velocity + 0.5 * elapsed**2 * force
        return position, velocity + elapsed * force, force


def path_among(plan: Plan, obstacles: Mapping[int, ObstacleTrajectory]) -> Path:
    """Return a plan's path in which those with a course fly it; their rows in the plan say where it ends."""
    time = plan.time()
    moving = {index: course for index, course in obstacles.items() if course.time[-1] > time[0] + _SAME_TIME}
    if not moving:
        return Path(time, plan.position, plan.velocity, plan.input)
    inner = np.unique(np.concatenate([course.time for course in moving.values()]))
    inner = inner[(inner > time[0]) & (inner < time[-1])]
    near = np.abs(time[:, None] - inner).min(axis=0) <= _SAME_TIME
    every = np.sort(np.concatenate([time, inner[~near]]))
    row = np.clip(np.searchsorted(time, every + _SAME_TIME, side="right") - 1, 0, plan.steps - 1)
    elapsed = (every - time[row])[:, None, None]
    force = plan.input[row]
    position = plan.position[row] + elapsed * plan.velocity[row] + 0.5 * elapsed**2 * force
    velocity = plan.velocity[row] + elapsed * force
    for index, course in moving.items():
        position[:, index], velocity[:, index], force[:, index] = course.at(every)
    return Path(every, position, velocity, force[:-1])
