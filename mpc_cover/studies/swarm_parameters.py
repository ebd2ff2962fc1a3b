"""Parameters of a simulation of the distributed law: the information, the delays, the law, and a scenario."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from mpc_cover.distributed.potential_law import LawParameters
from mpc_cover.mission.config import Area, BoxShape, Dynamics
from mpc_cover.mission.field import Field, build_field
from mpc_cover.mission.fleet import Fleet

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray


@dataclass(frozen=True)
class LookInformation:
    """K-coverage (5.2.1): `looks` K at every cell."""

    looks: int = 1


@dataclass(frozen=True)
class KalmanInformation:
    """Stochastic coverage (5.2.1): variances in the field's unit squared.

    Attributes
    ----------
    variance, enough : P(0) and P_max.
    noise : R of every sensor.
    bumps : of the random field that is to be estimated.
    """

    variance: float = 1.0
    noise: float = 1.0
    enough: float = 0.0625
    bumps: int = 5


@dataclass(frozen=True)
class AgeingInformation:
    """A field that changes in time: a look is valid for `fresh_s` [s]. Such a run ends at its time limit."""

    fresh_s: float = 10.0


Information = LookInformation | KalmanInformation | AgeingInformation


@dataclass(frozen=True)
class SwarmParameters:
    """How a fleet is flown.

    Attributes
    ----------
    information : what "measured" means.
    delay : samples by which each agent knows of the others (delta of 6.3; 0: global knowledge), or "hops", with
        which messages travel one hop a sample through the current communication graph.
    law : tuning of the potential law.
    dynamics : single integrators (5.1), or double integrators within the fleet's u_max and v_max (3.1).
    period_s : T_s.
    repel_within_m, attract_beyond_m : R_B and R_C; left out, 2 rho_B and 8/11 rho_C of the fleet, as in 6.3.
    patience_s : time without a change of the map after which an agent attends to one cell (`distributed.stall_escape`).
    time_limit_s : when to give up.
    maps_every : samples between recorded maps; 0 records none.
    """

    information: Information = field(default_factory=LookInformation)
    delay: int | Literal["hops"] = 0
    law: LawParameters = field(default_factory=LawParameters)
    dynamics: Dynamics = Dynamics.SINGLE
    period_s: float = 0.5
    repel_within_m: float | None = None
    attract_beyond_m: float | None = None
    patience_s: float = 10.0
    time_limit_s: float = 600.0
    maps_every: int = 0


@dataclass(frozen=True)
class Scenario:
    """A fleet of equal agents at random starts in a box, and how it is flown.

    Attributes
    ----------
    swarm : how it is flown.
    size_m : of the box W, which agents do not leave.
    cell_size_m : edge of a cell.
    agents : m.
    radius_m : rho.
    speed_max_m_per_s : v_max; u_max of single integrators.
    input_max_m_per_s2 : u_max of double integrators.
    separation_m : rho_B; 0 for none.
    range_m : rho_C; inf for none.
    """

    swarm: SwarmParameters = field(default_factory=SwarmParameters)
    size_m: tuple[float, ...] = (10.0, 10.0)
    cell_size_m: float = 0.5
    agents: int = 8
    radius_m: float = 1.0
    speed_max_m_per_s: float = 1.0
    input_max_m_per_s2: float = 1.0
    separation_m: float = 0.0
    range_m: float = np.inf

    def build(self, rng: np.random.Generator) -> tuple[Fleet, Field]:
        """Return the fleet at random starts, separated and connected where that is asked for, and the cells."""
        upper = np.array(self.size_m)
        box = BoxShape(kind="box", min_m=(0.0,) * upper.size, max_m=self.size_m)
        agents = self.agents
        fleet = Fleet(
            ids=tuple(f"a{i + 1}" for i in range(agents)),
            start=random_start(rng, agents, upper, self.separation_m, self.range_m),
            input_max=np.full(agents, self.input_max_m_per_s2),
            speed_max=np.full(agents, self.speed_max_m_per_s),
            radius=np.full((agents, 1), self.radius_m),
            separation_min=self.separation_m,
            communication_range=self.range_m,
            motion_min=np.zeros(upper.size),
            motion_max=upper,
        )
        return fleet, build_field(Area(shape=box, cell_size_m=self.cell_size_m))


_TRIES = 20_000
"""Draws before a box is considered too small."""
_SPARE = 0.1
"""How far starts stay from rho_B and rho_C, as a part of them."""


def random_start(rng: np.random.Generator, agents: int, upper: FloatArray, apart: float, reach: float) -> FloatArray:
    """Return (m, d) random positions [m] in a box: `apart` from each other, each within `reach` of an earlier one.

    Raises
    ------
    ValueError
        There is no room for them.
    """
    placed: list[FloatArray] = []
    for _ in range(_TRIES):
        point = rng.uniform(0.0, upper)
        away = np.linalg.norm(np.array(placed) - point, axis=1) if placed else np.empty(0)
        linked = not placed or away.min() <= (1.0 - _SPARE) * reach
        if linked and (away >= (1.0 + _SPARE) * apart).all():
            placed.append(point)
        if len(placed) == agents:
            return np.array(placed)
    raise ValueError(f"{agents} agents {apart:g} m apart and {reach:g} m from the next: no room in {upper} m")
