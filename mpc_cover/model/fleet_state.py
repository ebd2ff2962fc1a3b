"""The state of the fleet at an instant: what a control law decides from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpc_cover.model.trajectory import Trajectory

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class FleetState:
    """The state that a plan starts from: (m, d) position [m] and velocity [m/s] at a mission time [s]."""

    position: FloatArray
    velocity: FloatArray
    time: float

    def trajectory(self, later: FloatArray, period: float) -> Trajectory:
        """Return the motion with velocities `later` (N, m, d) [m/s] at samples 1 to N."""
        return Trajectory.from_velocities(self.position, self.velocity, later, self.time, period)
