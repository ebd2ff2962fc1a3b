"""The fleet as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.mission.config import Dynamics

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.config import AgentSpec, MissionSpec


@dataclass(frozen=True, eq=False)
class Fleet:
    """m agents in d dimensions, J magnitudes, as the mission specifies them.

    Attributes
    ----------
    ids : agent ids, in the order of every array's agent axis.
    start : (m, d) [m], at rest.
    input_max, speed_max : (m,) [m/s^2], [m/s]  (3.11, 3.12).
    radius : (m, J) [m]; -inf where agent i cannot measure magnitude j  (4.29). When h faults are tolerated, each
        magnitude stands here once for every set of m - h agents, measured by these alone (section 4.1).
    separation_min : rho_B [m] (4.18); 0 when not asked for.
    communication_range : rho_C [m] (4.20); inf when not asked for.
    motion_min, motion_max : (d,) [m]  (3.13, 3.14).
    magnitudes : a name for each column of `radius`.
    links : pairs (i, j) that always stay within `communication_range` (4.19).
    """

    ids: tuple[str, ...]
    start: FloatArray
    input_max: FloatArray
    speed_max: FloatArray
    radius: FloatArray
    separation_min: float
    communication_range: float
    motion_min: FloatArray
    motion_max: FloatArray
    magnitudes: tuple[str, ...] = ("coverage",)
    links: tuple[tuple[int, int], ...] = ()

    @property
    def sensing_radius_min(self) -> float:
        """The smallest sensing radius [m], to which tolerances and margins are relative."""
        return float(self.radius[np.isfinite(self.radius)].min())

    @property
    def size(self) -> int:
        """Number of agents m."""
        return len(self.ids)

    @property
    def dimension(self) -> int:
        """Number of spatial dimensions d."""
        return int(self.start.shape[1])


def agent_value(spec: MissionSpec, agent: AgentSpec, name: str) -> object:
    """Return an agent's own value, or the fleet's default, or None."""
    own = getattr(agent, name)
    return own if own is not None else getattr(spec.fleet.defaults, name)


def agent_radii(spec: MissionSpec, agent: AgentSpec) -> FloatArray:
    """Return the (J,) sensing radii [m] of an agent, -inf for what it cannot measure."""
    radius = agent_value(spec, agent, "sensing_radius_m")
    if isinstance(radius, dict):
        return np.array([radius.get(name, -np.inf) for name in spec.magnitudes], dtype=float)
    return np.full(len(spec.magnitudes), float(radius))  # type: ignore[arg-type]


def agent_input_max(spec: MissionSpec, agent: AgentSpec) -> float | None:
    """Return the bound on an agent's input [m/s^2], given or as force over mass; None where neither is given.

    Single integrators need none: the largest change of their velocity in a period stands in for it.
    """
    given = agent_value(spec, agent, "input_max_m_per_s2")
    if isinstance(given, float):
        return given
    mass, force = agent_value(spec, agent, "mass_kg"), agent_value(spec, agent, "force_max_n")
    if isinstance(mass, float) and isinstance(force, float):
        return force / mass
    speed = agent_value(spec, agent, "speed_max_m_per_s")
    jumps = spec.fleet.dynamics is Dynamics.SINGLE and isinstance(speed, float)
    return 2.0 * speed / spec.control.period_s if jumps and isinstance(speed, float) else None


def surviving_radii(radius: FloatArray, faults: int) -> FloatArray:
    """Return (m, J C(m, h)): each magnitude once for every set of h agents that may fail (section 4.1)."""
    agents = radius.shape[0]
    columns = []
    for magnitude in range(radius.shape[1]):
        for lost in combinations(range(agents), faults):
            column = radius[:, magnitude].copy()
            column[list(lost)] = -np.inf
            columns.append(column)
    return np.stack(columns, axis=1)


def surviving_names(spec: MissionSpec) -> tuple[str, ...]:
    """Return a name for each column of `surviving_radii`."""
    ids = [agent.id for agent in spec.fleet.agents]
    return tuple(
        f"{name} without {', '.join(lost)}" if lost else name
        for name in spec.magnitudes
        for lost in combinations(ids, spec.fleet.faults_tolerated)
    )


def build_fleet(spec: MissionSpec, motion_min: FloatArray, motion_max: FloatArray) -> Fleet:
    """Return the fleet of a mission that `validation` has passed."""
    agents = spec.fleet.agents
    reach = spec.fleet.communication_range_m
    index = {agent.id: i for i, agent in enumerate(agents)}
    return Fleet(
        ids=tuple(agent.id for agent in agents),
        start=np.array([agent.start_m for agent in agents], dtype=float),
        input_max=np.array([agent_input_max(spec, a) for a in agents], dtype=float),
        speed_max=np.array([agent_value(spec, a, "speed_max_m_per_s") for a in agents], dtype=float),
        radius=surviving_radii(np.array([agent_radii(spec, a) for a in agents]), spec.fleet.faults_tolerated),
        separation_min=spec.fleet.separation_min_m,
        communication_range=np.inf if reach is None else reach,
        motion_min=motion_min,
        motion_max=motion_max,
        magnitudes=surviving_names(spec),
        links=tuple((index[a], index[b]) for a, b in spec.fleet.links),
    )
