"""The state of the fleet at an instant: who takes part, where, how fast it can be, and what is in the way."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.trajectory import Trajectory

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mpc_cover.arrays import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class FleetState:
    """What a control law decides from, and what the safety filter judges by.

    Attributes
    ----------
    position, velocity : (m, d) [m], [m/s] predicted at `time`; of agents that are lost, where they come to rest.
    time : mission time [s].
    lost : (m,) who takes part no more: an obstacle for the others.
    speed_share : (m,) the part of its speed limit that each agent reaches, as far as it has shown.
    obstacles : how the lost who still move come to rest, by number, in mission time.
    settled : whether everyone has reported to be at rest, with nothing left to fly: there is time to plan thoroughly.
    """

    position: FloatArray
    velocity: FloatArray
    time: float
    lost: BoolArray
    speed_share: FloatArray
    obstacles: Mapping[int, Trajectory] = field(default_factory=dict)
    settled: bool = False

    @classmethod
    def nominal(cls, position: FloatArray, velocity: FloatArray, time: float, *, settled: bool = False) -> FleetState:
        """Return the state of a fleet in which everyone takes part, at full speed."""
        agents = position.shape[0]
        return cls(position, velocity, time, np.zeros(agents, dtype=bool), np.ones(agents), settled=settled)

    @property
    def actual(self) -> tuple[FloatArray, FloatArray]:
        """Position and velocity (m, d) at `time`, with the lost where they still are."""
        position, velocity = self.position.copy(), self.velocity.copy()
        for index, course in self.obstacles.items():
            position[index], velocity[index] = course.at(self.time)
        return position, velocity

    def trajectory(self, later: FloatArray, period: float) -> Trajectory:
        """Return the motion from here with velocities `later` (N, m, d) [m/s] at samples 1 to N."""
        return Trajectory.from_velocities(self.position, self.velocity, later, self.time, period)
