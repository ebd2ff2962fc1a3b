"""The fleet's predicted state at an instant: positions, velocities, lost agents, speed limits, moving obstacles."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.trajectory import Trajectory

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mpc_cover.arrays import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class FleetState:
    """Input of the control law and of the safety filter.

    Attributes
    ----------
    position, velocity : (m, d) [m], [m/s] predicted at `time`; of lost agents, the state in which they come to rest.
    time : mission time [s].
    lost : (m,) mask of lost agents, which are obstacles for the others.
    speed_share : (m,) part of its speed limit that each agent has been observed to reach.
    obstacles : trajectories, in mission time, of lost agents that still move, by agent index.
    held : motions (N+1, d), in mission time, of which an agent flies one, by agent index; see `control.held_plans`.
    settled : whether all agents have reported to be at rest with no plan left to fly: there is time for a long search.
    """

    position: FloatArray
    velocity: FloatArray
    time: float
    lost: BoolArray
    speed_share: FloatArray
    obstacles: Mapping[int, Trajectory] = field(default_factory=dict)
    held: Mapping[int, Sequence[Trajectory]] = field(default_factory=dict)
    settled: bool = False

    @classmethod
    def nominal(cls, position: FloatArray, velocity: FloatArray, time: float, *, settled: bool = False) -> FleetState:
        """Return the state of a fleet without lost or slow agents."""
        agents = position.shape[0]
        return cls(position, velocity, time, np.zeros(agents, dtype=bool), np.ones(agents), settled=settled)

    @property
    def acknowledged(self) -> bool:
        """Whether each agent has reported the plan that it flies, and none was sent to it since."""
        return all(len(motions) <= 1 for motions in self.held.values())

    @property
    def actual(self) -> tuple[FloatArray, FloatArray]:
        """Position and velocity (m, d) [m], [m/s] at `time`, with lost agents where they are at that time."""
        position, velocity = self.position.copy(), self.velocity.copy()
        for index, trajectory in self.obstacles.items():
            position[index], velocity[index] = trajectory.at(self.time)
        return position, velocity

    def trajectory(self, later: FloatArray, period: float) -> Trajectory:
        """Return the motion from this state with velocities `later` (N, m, d) [m/s] at samples 1 to N."""
        return Trajectory.from_velocities(self.position, self.velocity, later, self.time, period)
