"""The sizing model: the number of agents for a wanted rate of measurement, and the reverse (1.1 to 1.3).

The model scatters the fleet at random every 2 rho / v_max: the uncovered part shrinks geometrically. It ignores where
agents go, so a law that does not look twice beats it the more, the larger a part of the area the fleet sees.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.errors import InvalidInputError, Problem

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mpc_cover.arrays import FloatArray

_UNIT_S = 1.0
"""The time unit of (1.1)."""
_MOST_AGENTS = 1_000_000


@dataclass(frozen=True)
class SizingProblem:
    """An area and one kind of agent.

    Attributes
    ----------
    area_m2 : A_tot.
    radius_m : rho_S.
    speed_m_per_s : v_max.
    cover : the part of the area that a measurement round covers, above 0 and below 1.

    Raises
    ------
    InvalidInputError
        A number is out of its range, or a disc is larger than the area.
    """

    area_m2: float
    radius_m: float
    speed_m_per_s: float
    cover: float = 0.95

    def __post_init__(self) -> None:
        problems = [
            Problem(name, value, "must be greater than 0 and finite")
            for name in ("area_m2", "radius_m", "speed_m_per_s")
            if not 0.0 < (value := getattr(self, name)) < math.inf
        ]
        if not 0.0 < self.cover < 1.0:
            problems.append(Problem("cover", self.cover, "must be greater than 0 and less than 1"))
        if not problems and self.disc_part >= 1.0:
            problems.append(Problem("radius_m", self.radius_m, f"its disc must be smaller than {self.area_m2:g} m^2"))
        if not problems and self.speed_m_per_s * _UNIT_S > 2.0 * self.radius_m:
            right = f"must be at most 2 radius_m a second, {2.0 * self.radius_m:g} m/s: (1.1) goes by whole seconds"
            problems.append(Problem("speed_m_per_s", self.speed_m_per_s, right))
        if problems:
            raise InvalidInputError("fleet sizing", problems)

    @property
    def disc_part(self) -> float:
        """Part of the area that one sensing disc covers, pi rho^2 / A_tot."""
        return math.pi * self.radius_m**2 / self.area_m2


def swept_part(problem: SizingProblem, agents: int) -> float:
    """Return the part of the area that N agents cover in a second, dA_N / A_tot [1/s]."""
    seen = -math.expm1(agents * math.log1p(-problem.disc_part))
    return problem.speed_m_per_s / (2.0 * problem.radius_m) * seen


def covered_fraction(problem: SizingProblem, agents: int, time: FloatArray) -> FloatArray:
    """Return the covered part of the area at (T,) times [s] from the start (1.2)."""
    static = agents * math.log1p(-problem.disc_part)
    return np.asarray(-np.expm1(static + np.asarray(time) / _UNIT_S * math.log1p(-swept_part(problem, agents))))


def measurement_rate(problem: SizingProblem, agents: int) -> float:
    """Return how often a second N agents cover the wanted part (1.3) [Hz]; inf where they do without moving."""
    left = math.log1p(-problem.cover) - agents * math.log1p(-problem.disc_part)
    return math.inf if left >= 0.0 else math.log1p(-swept_part(problem, agents)) / left / _UNIT_S


def fastest_rate(problem: SizingProblem) -> float:
    """Return v_max / (2 rho) [Hz], above which the model means nothing: it scatters the fleet anew no sooner.

    A fleet that sees everything at rest needs no rounds, and is no answer to how many rounds it makes.
    """
    return problem.speed_m_per_s / (2.0 * problem.radius_m)


def agents_for_rate(problem: SizingProblem, rate_hz: float) -> int:
    """Return the least number of agents that covers the wanted part at a rate [Hz] or faster, by (1.3).

    The rate rises with every agent, and is infinite as soon as the discs at rest cover the wanted part.

    Raises
    ------
    InvalidInputError
        The rate is not a positive number, or would take more than a million agents.
    """
    if not 0.0 < rate_hz < math.inf:
        raise InvalidInputError("fleet sizing", [Problem("rate_hz", rate_hz, "must be greater than 0 and finite")])
    enough = 1
    while measurement_rate(problem, enough) < rate_hz:
        enough *= 2
        if enough > _MOST_AGENTS:
            raise InvalidInputError("fleet sizing", [Problem("rate_hz", rate_hz, "takes more than a million agents")])
    fewer = enough // 2
    while enough - fewer > 1:
        middle = (enough + fewer) // 2
        if measurement_rate(problem, middle) < rate_hz:
            fewer = middle
        else:
            enough = middle
    return enough


@dataclass(frozen=True)
class SizingRow:
    """The result for a number of agents: the rate [Hz], the time of a round [s], the part seen at rest."""

    agents: int
    rate_hz: float
    round_s: float
    at_rest: float


def sizing_table(problem: SizingProblem, numbers: Iterable[int]) -> list[SizingRow]:
    """Return a row for each number of agents."""
    rows = []
    for agents in numbers:
        rate = measurement_rate(problem, agents)
        at_rest = float(covered_fraction(problem, agents, np.zeros(1))[0])
        rows.append(SizingRow(agents, rate, 0.0 if math.isinf(rate) else 1.0 / rate, at_rest))
    return rows


@dataclass(frozen=True)
class ModelError:
    """The model's error against a simulation: mean and largest |difference| of the covered part."""

    agents: int
    mean_absolute: float
    largest: float


def model_error(problem: SizingProblem, agents: int, time: FloatArray, covered: FloatArray) -> ModelError:
    """Compare (1.2) with the covered part (T,) that was simulated at evenly spaced times (T,) [s]."""
    difference = np.abs(covered_fraction(problem, agents, time) - covered)
    return ModelError(agents, float(difference.mean()), float(difference.max()))
