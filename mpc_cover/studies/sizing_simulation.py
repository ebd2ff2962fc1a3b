"""Figures 1.1 and 1.2: the sizing model against simulations of the potential law, averaged over random starts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.studies.fleet_sizing import (
    ModelError,
    SizingProblem,
    covered_fraction,
    measurement_rate,
    model_error,
)
from mpc_cover.studies.swarm import run
from mpc_cover.studies.swarm_parameters import LookInformation, Scenario, SwarmParameters

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from mpc_cover.arrays import FloatArray

_CELLS_A_RADIUS = 4
"""So fine that cells hardly matter."""
_PERIOD_S = 0.25


@dataclass(frozen=True, eq=False)
class CoverageCurve:
    """The covered part over time, of the model and of simulations (figure 1.1).

    Attributes
    ----------
    time : (T,) [s].
    model : (T,) by (1.2).
    simulated : (T,) mean over the seeds.
    spread : (2, T) the smallest and largest over the seeds.
    rounds_s : (S,) time that each seed took to cover the wanted part; inf for never.
    error : between model and mean.
    """

    agents: int
    time: FloatArray
    model: FloatArray
    simulated: FloatArray
    spread: FloatArray
    rounds_s: FloatArray
    error: ModelError

    @property
    def rate_hz(self) -> float:
        """The rate of measurement that the simulations give [Hz]."""
        return 1.0 / float(self.rounds_s.mean())


def scenario_of(problem: SizingProblem, agents: int) -> Scenario:
    """Return a square of the problem's area with N agents that fly by the potential law, without constraints."""
    edge = math.sqrt(problem.area_m2)
    cells = max(1, round(edge / problem.radius_m * _CELLS_A_RADIUS))
    swarm = SwarmParameters(information=LookInformation(1), period_s=_PERIOD_S)
    return Scenario(
        swarm,
        size_m=(edge, edge),
        cell_size_m=edge / cells,
        agents=agents,
        radius_m=problem.radius_m,
        speed_max_m_per_s=problem.speed_m_per_s,
    )


def coverage_curve(problem: SizingProblem, agents: int, seeds: range, duration_s: float | None = None) -> CoverageCurve:
    """Simulate N agents once for each seed and compare with the model.

    `duration_s` is the duration of both; by default until the model covers the wanted part.
    """
    longest = duration_s if duration_s is not None else 1.0 / measurement_rate(problem, agents)
    time = np.arange(0.0, longest + _PERIOD_S, _PERIOD_S)
    records = [run(scenario_of(problem, agents), seed) for seed in seeds]
    return curve_of(problem, agents, time, [record.covered_at for record in records])


def curve_of(problem: SizingProblem, agents: int, time: FloatArray, covered_at: Sequence[FloatArray]) -> CoverageCurve:
    """Return the curve over (T,) times [s] of flights whose cells were covered at (K,) [s], inf for never."""
    ordered = [np.sort(each) for each in covered_at]
    every = np.array([np.searchsorted(each, time + 1e-9, side="right") / each.size for each in ordered])
    rounds = [each[max(1, math.ceil(problem.cover * each.size - 1e-9)) - 1] for each in ordered]
    mean, spread = every.mean(axis=0), np.array([every.min(axis=0), every.max(axis=0)])
    model = covered_fraction(problem, agents, time)
    error = model_error(problem, agents, time, mean)
    return CoverageCurve(agents, time, model, mean, spread, np.array(rounds), error)


def coverage_curves(
    problem: SizingProblem, numbers: Iterable[int] = (5, 10, 15), seeds: range = range(10)
) -> list[CoverageCurve]:
    """Return a curve for each number of agents, all as long as the slowest by the model (figure 1.1)."""
    counts = list(numbers)
    duration = max(1.0 / measurement_rate(problem, agents) for agents in counts)
    return [coverage_curve(problem, agents, seeds, duration) for agents in counts]
