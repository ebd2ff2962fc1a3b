"""What simulated agents suffer: noise, gusts, wind and weakness, from a seeded generator."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.config import Disturbance
    from mpc_cover.mission.load import Mission


def disturbs_motion(given: Disturbance) -> bool:
    """Return whether agents stray from their plans at all; a delay alone does not."""
    random = given.position_noise_m > 0.0 or given.input_noise_m_per_s2 > 0.0
    return random or any(given.wind_m_per_s2) or any(part < 1.0 for part in given.slow_agents.values())


class AgentDisturbance:
    """One agent's share of the disturbances; the same seed gives the same draws in the same order.

    Attributes
    ----------
    wind : (d,) constant acceleration [m/s^2].
    speed_max : what the agent can really reach [m/s], inf for whatever it is asked to.
    """

    def __init__(self, given: Disturbance, dimension: int, speed_max: float, seed: tuple[int, ...]) -> None:
        self.wind: FloatArray = np.array(given.wind_m_per_s2 or np.zeros(dimension), dtype=float)
        self.speed_max = speed_max
        self._noise_m, self._gust = given.position_noise_m, given.input_noise_m_per_s2
        self._dimension = dimension
        self._random = np.random.default_rng(seed)

    def noise(self) -> FloatArray:
        """Draw how far off a measured position is, (d,) [m]."""
        return sample_ball(self._random, self._noise_m, self._dimension)

    def gust(self) -> FloatArray:
        """Draw the disturbance of a state period, (d,) [m/s^2]."""
        return sample_ball(self._random, self._gust, self._dimension)


def agent_disturbance(mission: Mission, index: int, seed: int) -> AgentDisturbance:
    """Return what the mission's agent number `index` suffers."""
    fleet, given = mission.fleet, mission.spec.disturbance
    part = given.slow_agents.get(fleet.ids[index], 1.0)
    speed_max = part * float(fleet.speed_max[index]) if part < 1.0 else np.inf
    return AgentDisturbance(given, fleet.dimension, speed_max, (seed, index))


def undisturbed(mission: Mission, speed_max: float) -> AgentDisturbance:
    """Return what the controller reckons with: no noise, no gust, no wind, but perhaps a slow agent [m/s]."""
    return AgentDisturbance(type(mission.spec.disturbance)(), mission.fleet.dimension, speed_max, ())


def sample_ball(random: np.random.Generator, radius: float, dimension: int) -> FloatArray:
    """Draw uniformly from a ball of this radius, (d,)."""
    direction = random.standard_normal(dimension)
    length = float(np.linalg.norm(direction))
    reach = radius * random.uniform() ** (1.0 / dimension)
    return np.asarray(reach / length * direction) if length > 0.0 else direction


def saturated_acceleration(velocity: FloatArray, force: FloatArray, duration: float, speed_max: float) -> FloatArray:
    """Return the acceleration (d,) [m/s^2] left of `force` when the speed cannot exceed `speed_max` [m/s].

    The velocity at the end of `duration` [s] is projected onto the ball of what can be reached. With a velocity
    (d,) inside it, the projection only shortens the acceleration, and the speed is within it all along.
    """
    after = velocity + duration * force
    speed = float(np.linalg.norm(after))
    if speed <= speed_max or duration <= 0.0:
        return force
    return np.asarray((speed_max / speed * after - velocity) / duration)
