"""Simulated disturbances: position noise, gusts, wind and reduced speed, from a seeded generator."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.config import Disturbance
    from mpc_cover.mission.load import Mission


def disturbs_motion(given: Disturbance) -> bool:
    """Return whether the disturbances move agents off their plans; a delay alone does not."""
    random = given.position_noise_m > 0.0 or given.input_noise_m_per_s2 > 0.0
    return random or any(given.wind_m_per_s2) or any(part < 1.0 for part in given.slow_agents.values())


class AgentDisturbance:
    """The disturbances of one agent; the same seed gives the same draws in the same order.

    Attributes
    ----------
    wind : (d,) constant acceleration [m/s^2].
    speed_max : speed that the agent can reach [m/s]; inf where it reaches any speed it is commanded.
    """

    def __init__(self, given: Disturbance, dimension: int, speed_max: float, seed: tuple[int, ...]) -> None:
        self.wind: FloatArray = np.array(given.wind_m_per_s2 or np.zeros(dimension), dtype=float)
        self.speed_max = speed_max
        self._noise_m, self._gust = given.position_noise_m, given.input_noise_m_per_s2
        self._dimension = dimension
        self._random = np.random.default_rng(seed)

    def noise(self) -> FloatArray:
        """Draw the error of a measured position, (d,) [m]."""
        return sample_ball(self._random, self._noise_m, self._dimension)

    def gust(self) -> FloatArray:
        """Draw the acceleration that disturbs one state period, (d,) [m/s^2]."""
        return sample_ball(self._random, self._gust, self._dimension)


def agent_disturbance(mission: Mission, index: int, seed: int) -> AgentDisturbance:
    """Return the disturbances of agent number `index` of a mission, as seeded by `seed`."""
    fleet, given = mission.fleet, mission.spec.disturbance
    part = given.slow_agents.get(fleet.ids[index], 1.0)
    speed_max = part * float(fleet.speed_max[index]) if part < 1.0 else np.inf
    return AgentDisturbance(given, fleet.dimension, speed_max, (seed, index))


def undisturbed(mission: Mission, speed_max: float) -> AgentDisturbance:
    """Return the nominal model of the controller: no noise, gust or wind, but possibly a reduced `speed_max` [m/s]."""
    return AgentDisturbance(type(mission.spec.disturbance)(), mission.fleet.dimension, speed_max, ())


def sample_ball(random: np.random.Generator, radius: float, dimension: int) -> FloatArray:
    """Draw a (d,) vector uniformly from the ball of this radius."""
    direction = random.standard_normal(dimension)
    length = float(np.linalg.norm(direction))
    reach = radius * random.uniform() ** (1.0 / dimension)
    return np.asarray(reach / length * direction) if length > 0.0 else direction


def saturated_acceleration(velocity: FloatArray, force: FloatArray, duration: float, speed_max: float) -> FloatArray:
    """Return the acceleration (d,) [m/s^2] that remains of `force` (d,) when the speed saturates at `speed_max` [m/s].

    The velocity at the end of `duration` [s] is projected onto the ball of attainable velocities. For a velocity
    (d,) inside that ball, the projection only shortens the acceleration, and the speed stays within it throughout.
    """
    after = velocity + duration * force
    speed = float(np.linalg.norm(after))
    if speed <= speed_max or duration <= 0.0:
        return force
    return np.asarray((speed_max / speed * after - velocity) / duration)
