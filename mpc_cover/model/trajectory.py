"""A plan: the motion of the whole fleet over a horizon, ending at rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Plan:
    """A sampled motion under a zero-order hold; after its end the fleet stays at rest.

    Attributes
    ----------
    start_time : mission time of sample 0 [s].
    period : T_s [s].
    position, velocity : (N+1, m, d) [m], [m/s].
    input : (N, m, d) [m/s^2].
    """

    start_time: float
    period: float
    position: FloatArray
    velocity: FloatArray
    input: FloatArray

    @property
    def steps(self) -> int:
        """Number of steps N."""
        return int(self.input.shape[0])

    @property
    def end_time(self) -> float:
        """Mission time of the last sample [s]; at rest from then on."""
        return self.start_time + self.steps * self.period

    def time(self) -> FloatArray:
        """Return the (N+1,) sample times [s]."""
        return self.start_time + self.period * np.arange(self.steps + 1, dtype=float)

    def state_at(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        """Return position and velocity (m, d) at a mission time: exact between samples, rest after the end."""
        elapsed = max(0.0, time_s - self.start_time)
        index = int(elapsed / self.period + 1e-9)
        if index >= self.steps:
            return self.position[-1], np.zeros_like(self.velocity[-1])
        dt = elapsed - index * self.period
        force = self.input[index]
        velocity = self.velocity[index]
        return self.position[index] + dt * velocity + 0.5 * dt**2 * force, velocity + dt * force


def resting_plan(position: FloatArray, start_time: float, period: float, steps: int) -> Plan:
    """Return the plan that stays where it is."""
    held = np.repeat(position[None], steps + 1, axis=0)
    return Plan(start_time, period, held, np.zeros_like(held), np.zeros_like(held[1:]))
