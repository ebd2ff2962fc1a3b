"""`mpc-cover size`: the sizing model's answers, its figures, and its error against simulations (1.1 to 1.3)."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.errors import InvalidInputError, Problem, UserError
from mpc_cover.studies.fleet_sizing import (
    SizingProblem,
    SizingRow,
    agents_for_rate,
    fastest_rate,
    measurement_rate,
    sizing_table,
)
from mpc_cover.studies.sizing_simulation import CoverageCurve, coverage_curve, scenario_of
from mpc_cover.view.sizing_figures import figure_1_1, figure_1_2
from mpc_cover.view.style import house_style, save_figure

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

_MOST_SIMULATED = 200
_MOST_CELLS = 40_000
_MOST_AGENTS = 1_000_000
_OPTIONS = {"area_m2": "--area", "radius_m": "--radius", "speed_m_per_s": "--speed", "rate_hz": "--rate"}


@dataclass(frozen=True)
class SizingOptions:
    """See `mpc-cover size --help`; a rate is in Hz, `numbers` of agents are simulated and tabulated."""

    rate_hz: float | None = None
    numbers: tuple[int, ...] = (5, 10, 15)
    seeds: int = 10
    horizon_seeds: int = 0
    seed: int = 0


@dataclass(frozen=True, eq=False)
class SizingAnswer:
    """The problem and its answer.

    Attributes
    ----------
    agents_needed : for the wanted rate by the model; None when none is given.
    table : a row for each number of agents, by the model.
    potential, horizon : simulations by the potential law and by the receding horizon; empty when not asked for.
    """

    problem: SizingProblem
    rate_hz: float | None
    agents_needed: int | None
    table: list[SizingRow]
    potential: list[CoverageCurve]
    horizon: list[CoverageCurve]

    def to_dict(self) -> dict[str, Any]:
        """Return it for `--json`; a rate or a round that is infinite is null."""
        return {
            "problem": asdict(self.problem),
            "rate_hz": self.rate_hz,
            "agents_needed": self.agents_needed,
            "agents_needed_simulated": {
                "potential": self.simulated_needed(self.potential),
                "receding_horizon": self.simulated_needed(self.horizon),
            },
            "table": [_finite(asdict(row)) for row in self.table],
            "potential": [_curve(curve) for curve in self.potential],
            "receding_horizon": [_curve(curve) for curve in self.horizon],
        }

    def simulated_needed(self, curves: Sequence[CoverageCurve]) -> int | None:
        """Return the least of the simulated numbers whose mean round is short enough; None where none is."""
        if self.rate_hz is None:
            return None
        enough = [curve.agents for curve in curves if float(curve.rounds_s.mean()) * self.rate_hz <= 1.0]
        return min(enough, default=None)

    @property
    def simulated_texts(self) -> list[str]:
        """What the simulations say of the wanted rate, beside the model, and how far the two differ."""
        lines = []
        for law, curves in (("potential law", self.potential), ("receding horizon", self.horizon)):
            if not curves:
                continue
            numbers = ", ".join(str(curve.agents) for curve in curves)
            least = self.simulated_needed(curves)
            doubt = max(curve.error.largest for curve in curves)
            said = (
                f"the least of them that is fast enough is {least} agents"
                if least is not None
                else "none of them is fast enough: try more with --agents"
            )
            lines.append(
                f"simulated with the {law} (N = {numbers}), {said}; the covered parts differ from the model's by up to "
                f"{100.0 * doubt:.0f} %"
            )
        return lines or ["not simulated: the model alone is in doubt by several times; see --seeds"]

    @property
    def text(self) -> str:
        """The answer as a text for users."""
        lines = []
        if self.rate_hz is not None and self.agents_needed is not None:
            lines += [
                f"{self.rate_hz:g} Hz, a round of {1.0 / self.rate_hz:.4g} s:",
                f"  the model (1.3), which scatters agents at random, says {self.agents_needed} agents",
                *(f"  {text}" for text in self.simulated_texts),
            ]
        for row in self.table:
            turn = (
                "seen at rest" if math.isinf(row.rate_hz) else f"{row.rate_hz:.4f} Hz, a round of {row.round_s:.1f} s"
            )
            lines.append(f"N = {row.agents:3d}: {turn}; at rest {100.0 * row.at_rest:.1f} % are seen")
        for law, curves in (("potential law", self.potential), ("receding horizon", self.horizon)):
            for curve in curves:
                rounds = "never" if math.isinf(curve.rounds_s.mean()) else f"{curve.rounds_s.mean():.1f} s"
                lines.append(
                    f"N = {curve.agents:3d}, {law}, {curve.rounds_s.size} seeds: a round of {rounds}; the model's "
                    f"mean absolute error {100.0 * curve.error.mean_absolute:.1f} %, "
                    f"largest {100.0 * curve.error.largest:.1f} %"
                )
        return "\n".join(lines)


def size(problem: SizingProblem, options: SizingOptions, on_progress: Callable[[str], None]) -> SizingAnswer:
    """Answer by the model, and by simulations where asked for.

    Raises
    ------
    UserError
        Invalid numbers, or simulations that would take too long.
    """
    _check(problem, options)
    needed = None if options.rate_hz is None else agents_for_rate(problem, options.rate_hz)
    numbers = sorted({*options.numbers, *([needed] if needed is not None else [])})
    duration = max((1.0 / measurement_rate(problem, number) for number in options.numbers), default=0.0)
    potential, horizon = [], []
    for number in options.numbers:
        if options.seeds:
            on_progress(f"N = {number}: flies the potential law from {options.seeds} random starts")
            seeds = range(options.seed, options.seed + options.seeds)
            potential.append(coverage_curve(problem, number, seeds, duration))
        if options.horizon_seeds:
            from mpc_cover.studies.sizing_horizon import horizon_curve  # noqa: PLC0415 - heavy, and seldom asked for

            on_progress(f"N = {number}: flies the receding horizon from {options.horizon_seeds} random starts")
            seeds = range(options.seed, options.seed + options.horizon_seeds)
            horizon.append(horizon_curve(problem, number, seeds, duration))
    return SizingAnswer(problem, options.rate_hz, needed, sizing_table(problem, numbers), potential, horizon)


def draw_sizing(answer: SizingAnswer, folder: Path) -> list[Path]:
    """Write figures 1.1 and 1.2 and the answer as JSON into a folder; return the files.

    Raises
    ------
    UserError
        The folder cannot be written.
    """
    most = max(20, *(row.agents for row in answer.table))
    agents = np.unique(np.linspace(1, most, min(most, 200)).round())
    rate = np.array([measurement_rate(answer.problem, int(number)) for number in agents])
    try:
        folder.mkdir(parents=True, exist_ok=True)
        files = []
        with house_style():
            if answer.potential:
                files.append(save_figure(figure_1_1(answer.potential), folder / "figure-1.1.png"))
            if answer.horizon:
                drawn = figure_1_1(answer.horizon, law="receding horizon")
                files.append(save_figure(drawn, folder / "figure-1.1-receding-horizon.png"))
            curves = [curve for curve in answer.potential if math.isfinite(curve.rounds_s.mean())]
            figure = figure_1_2(agents, rate, answer.problem.cover, curves)
            files.append(save_figure(figure, folder / "figure-1.2.png"))
        file = folder / "size.json"
        file.write_text(json.dumps(answer.to_dict(), indent=2, allow_nan=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise UserError(f"--out {folder}: cannot be written: {error.strerror or error}") from None
    return [*files, file]


def sizing_problem(area_m2: float, radius_m: float, speed_m_per_s: float, cover: float) -> SizingProblem:
    """Return the problem.

    Raises
    ------
    InvalidInputError
        Invalid numbers, by the names of the options.
    """
    try:
        return SizingProblem(area_m2, radius_m, speed_m_per_s, cover)
    except InvalidInputError as error:
        named = [Problem(_OPTIONS.get(p.path, f"--{p.path}"), p.value, p.right) for p in error.problems]
        raise InvalidInputError("fleet sizing", named) from None


def _check(problem: SizingProblem, options: SizingOptions) -> None:
    problems = []
    if options.rate_hz is not None and not 0.0 < options.rate_hz < math.inf:
        problems.append(Problem("--rate", options.rate_hz, "must be a number of Hz greater than 0"))
    simulated = options.seeds + options.horizon_seeds > 0
    most = _MOST_SIMULATED if simulated else _MOST_AGENTS
    fastest = fastest_rate(problem)
    if options.rate_hz is not None and fastest < options.rate_hz < math.inf:
        right = (
            f"is impossible: must be at most {fastest:.3g} Hz: agents that need not move more than a diameter, "
            f"{2.0 * problem.radius_m:g} m, for a round still take {1.0 / fastest:.3g} s for that"
        )
        problems.append(Problem("--rate", options.rate_hz, right))
    for number in options.numbers:
        if not 1 <= number <= most:
            hint = " to be simulated; with --seeds 0 the model alone answers" if simulated else ""
            problems.append(Problem("--agents", number, f"must be between 1 and {most}{hint}"))
        elif simulated and math.isinf(measurement_rate(problem, number)):
            right = "see the wanted part at rest: there is nothing to simulate; with --seeds 0 the model alone answers"
            problems.append(Problem("--agents", number, right))
    if simulated:
        scenario = scenario_of(problem, 1)
        cells = round(scenario.size_m[0] / scenario.cell_size_m) ** 2
        if cells > _MOST_CELLS:
            right = f"takes {cells} cells to simulate, at most {_MOST_CELLS}: a smaller area, or --seeds 0"
            problems.append(Problem("--area", problem.area_m2, right))
    if problems:
        raise InvalidInputError("fleet sizing", problems)


def _curve(curve: CoverageCurve) -> dict[str, Any]:
    mean = float(curve.rounds_s.mean())
    return _finite(
        {
            "agents": curve.agents,
            "seeds": int(curve.rounds_s.size),
            "round_s": mean,
            "rate_hz": 0.0 if math.isinf(mean) else 1.0 / mean,
            "model_mean_absolute_error": curve.error.mean_absolute,
            "model_largest_error": curve.error.largest,
        }
    )


def _finite(row: dict[str, Any]) -> dict[str, Any]:
    return {name: None if isinstance(value, float) and math.isinf(value) else value for name, value in row.items()}


def parse_numbers(text: str) -> tuple[int, ...]:
    """Return the numbers of agents in a list with commas.

    Raises
    ------
    UserError
        It is no list of whole numbers.
    """
    parts: Sequence[str] = [part.strip() for part in text.split(",") if part.strip()]
    try:
        numbers = tuple(dict.fromkeys(int(part) for part in parts))
    except ValueError:
        raise UserError(f"--agents {text}: must be whole numbers, separated by commas") from None
    if not numbers:
        raise UserError("--agents: is empty: give one or more numbers, separated by commas")
    return numbers
