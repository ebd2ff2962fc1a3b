"""`mpc-cover bench planner`: all solvers solve the same problem, one after the other, judged by the same verifier."""

from __future__ import annotations

import csv
import io
import json
import math
import os
import platform
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

from mpc_cover.errors import UserError
from mpc_cover.studies.case import Guess, make_case, start_from
from mpc_cover.studies.peers.registry import OURS, chosen
from mpc_cover.studies.race import Limit, Run, race
from mpc_cover.studies.verdict import TOLERANCE, judge
from mpc_cover.version import __version__
from mpc_cover.view.benchmark import Curve, Row, draw_history

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from mpc_cover.mission.load import Mission
    from mpc_cover.studies.verdict import Verdict
    from mpc_cover.view.progress import ProgressLine

ALL_GUESSES = "all"
"""Stands for all guesses."""
_PACKAGES = ("casadi", "clarabel", "cvxpy", "jax", "numpy", "osqp", "piqp", "scipy")


@dataclass(frozen=True, eq=False)
class Race:
    """All peers from one guess: its name, the verdict on the guess itself, and each peer's run."""

    guess: Guess
    before: Verdict
    runs: tuple[Run, ...]


def guesses_of(name: str) -> tuple[Guess, ...]:
    """Return the guesses that a name stands for.

    Raises
    ------
    UserError
        It is neither a guess nor "all".
    """
    if name == ALL_GUESSES:
        return tuple(Guess)
    if name not in set(Guess):
        raise UserError(f"--guess {name}: is none: must be one of {', '.join(Guess)} or all")
    return (Guess(name),)


def run_benchmark(
    mission: Mission, guess: str, peers: str | None, limit: Limit, progress: RaceProgress | None = None
) -> list[Race]:
    """Let the peers of a comma-separated list (None: all) solve the mission from a guess, or from all of them.

    `progress` is told of each peer as it starts, and of its iterates as they come in.

    Raises
    ------
    UserError
        An unknown guess or peer.
    """
    names, entries = guesses_of(guess), chosen(peers)
    case = make_case(mission)
    races = []
    for name in names:
        x = start_from(case, name)
        runs = list[Run]()
        for number, entry in enumerate(entries, start=1):
            if progress is not None:
                progress.starts(entry.name, f"from {name}, {number} of {len(entries)}", runs)
            runs.append(race(entry.name, mission, x, limit, progress.seen if progress is not None else _ignore))
        races.append(Race(name, judge(case, x), tuple(runs)))
    return races


class RaceProgress:
    """Shows which peer solves, for how long, its best and that of the others so far."""

    def __init__(self, line: ProgressLine, limit: Limit) -> None:
        self._line, self._limit = line, limit
        self._others = ""

    def starts(self, name: str, where: str, before: Sequence[Run]) -> None:
        """Say that a peer starts, after others from the same guess."""
        unit = " processor" if self._limit.cpu_time else ""
        self._line.begin(f"{where}: {name}", None if unit else self._limit.seconds)
        held = [run for run in before if run.best is not None and run.best.verdict.holds_sampled]
        best = min(held, key=lambda run: (run.best.verdict.cost, run.time_s) if run.best else (), default=None)
        self._others = f"; best so far {best.name}, {_cost(best)}" if best is not None else ""
        self._line.show(f"sets up{self._others}")

    def seen(self, run: Run) -> None:
        """Show the run so far."""
        self._line.show(f"{_cost(run)} at {run.time_s:.1f} s{self._others}")


def _cost(run: Run) -> str:
    """Return what the best iterate of a run is worth."""
    if run.best is None:
        return "no iterate yet"
    held = "" if run.best.verdict.holds_sampled else ", which holds not"
    return f"J = {run.best.verdict.cost:.4g} m{held}"


def _ignore(run: Run) -> None:
    """Do nothing on progress."""
    del run


def rows_of(race_: Race) -> list[Row]:
    """Return a race as the table shows it; times are relative to those of `ours-native`, where it takes part."""
    ours = next((run.time_s for run in race_.runs if run.name == OURS and run.answered), None)
    return [_row(run, ours) for run in race_.runs]


def curves_of(race_: Race) -> list[Curve]:
    """Return each peer's least J over time, of iterates that hold at the samples."""
    curves = []
    for run in race_.runs:
        times, costs = list[float](), list[float]()
        for time_s, verdict in run.seen:
            if verdict.holds_sampled and (not costs or verdict.cost < costs[-1]):
                times.append(time_s)
                costs.append(verdict.cost)
        if times:
            curves.append(Curve(run.name, times, costs, run.time_s))
    return curves


def write_benchmark(folder: Path, mission: Mission, races: list[Race], limit: Limit) -> list[Path]:
    """Write bench.json, bench.csv and a figure for each guess.

    Raises
    ------
    UserError
        The folder cannot be written.
    """
    report = as_dict(mission, races, limit)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        files = [folder / "bench.json", folder / "bench.csv"]
        files[0].write_text(json.dumps(report, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        files[1].write_text(_as_csv(report), encoding="utf-8")
        for race_ in races:
            file = folder / f"bench-{race_.guess}.png"
            title = f"{mission.spec.name}, from {race_.guess}{' (processor time)' if limit.cpu_time else ''}"
            files.append(draw_history(curves_of(race_), title, file))
    except OSError as error:
        raise UserError(f"--out {folder}: cannot be written: {error.strerror or error}") from None
    return files


def as_dict(mission: Mission, races: list[Race], limit: Limit) -> dict[str, Any]:
    """Return everything as plain data for `--json` and bench.json; what is not finite becomes None."""
    return {
        "mission": mission.spec.name,
        "time_limit_s": limit.seconds,
        "clock": "processor" if limit.cpu_time else "wall",
        "tolerance": TOLERANCE,
        "version": __version__,
        "machine": {"system": platform.platform(), "python": platform.python_version(), "cores": os.cpu_count()},
        "packages": {name: _version(name) for name in _PACKAGES},
        "guesses": [
            {
                "guess": race_.guess,
                "J_m": race_.before.cost,
                "covered_percent": race_.before.covered_percent,
                "peers": [row.to_dict() for row in rows_of(race_)],
                "history": {run.name: _history(run) for run in race_.runs},
            }
            for race_ in races
        ],
    }


def _history(run: Run) -> dict[str, list[float | None]]:
    """Return all iterates, feasible or not: when, J, and the worst violation at the samples and along the path."""

    def column(values: list[float]) -> list[float | None]:
        return [float(f"{value:.6g}") if math.isfinite(value) else None for value in values]

    return {
        "time_s": column([time_s for time_s, _ in run.seen]),
        "J_m": column([verdict.cost for _, verdict in run.seen]),
        "violation_sampled": column([verdict.sampled for _, verdict in run.seen]),
        "violation_path": column([verdict.path for _, verdict in run.seen]),
    }


def _row(run: Run, ours: float | None) -> Row:
    best, flyable = run.best, run.flyable
    verdict = best.verdict if best is not None and best.verdict.holds_sampled else None
    shown = best.verdict if best is not None else None
    return Row(
        name=run.name,
        setup_s=run.setup_s if run.seen else None,
        time_s=run.time_s if run.seen else None,
        ratio=run.time_s / ours if ours and run.seen else None,
        cost_m=verdict.cost if verdict else None,
        covered_percent=verdict.covered_percent if verdict else None,
        best_at_s=best.time_s if best is not None and verdict else None,
        flyable_cost_m=flyable.verdict.cost if flyable else None,
        violation_sampled=shown.sampled if shown else None,
        violation_path=shown.path if shown else None,
        separation_sampled_m=shown.separation_sampled if shown else None,
        separation_path_m=shown.separation_path if shown else None,
        iterations=run.iterations if run.answered else None,
        status=run.status,
        worst=shown.worst if shown else "",
        holds=bool(shown and shown.holds),
    )


def _as_csv(report: dict[str, Any]) -> str:
    table = io.StringIO()
    rows = [{"guess": part["guess"], **row} for part in report["guesses"] for row in part["peers"]]
    writer = csv.DictWriter(table, fieldnames=list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return table.getvalue()


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
