"""`mpc-cover plan`: plans mission files one after another."""

from __future__ import annotations

import cProfile
import glob
import math
import pstats
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpc_cover.control.factory import require_double
from mpc_cover.errors import UnreadableFileError, UserError
from mpc_cover.mission.load import load_mission
from mpc_cover.output import any_of, check_folder, file_taken, output_path
from mpc_cover.planning.offline import PlanOptions, plan_mission
from mpc_cover.trajectory_file import save_trajectory
from mpc_cover.verification.check import check_trajectory
from mpc_cover.verification.report import Check, Report
from mpc_cover.verification.summary import RunSummary, summarise
from mpc_cover.view.progress import ProgressLine

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from rich.console import Console

    from mpc_cover.mission.load import Mission
    from mpc_cover.planning.offline import SearchNews

_OF_CVXPY = ("formulation", "cvxpy", "extra", "extra_value")
_PROFILED = 18
"""Lines of a profile."""


def plan_targets(what: str | Path, out: Path | None, *, folder: bool, overwrite: bool) -> list[tuple[str, Path]]:
    """Return the missions to plan, one or every one of a folder, each with the file that its plan is to be written to.

    Raises
    ------
    UserError
        A folder without missions, a mission that nobody can plan, or a file that cannot or must not be written.
    """
    if not folder:
        file = output_path(out, Path("plan.npz"), file_taken, overwrite=overwrite)
        if file.suffix != ".npz":
            raise UserError(f"--out {file}: must end in .npz")
        if file.is_dir() or not file.parent.is_dir():
            raise UserError(f"--out {file}: cannot be written: must be a file in a folder that exists")
        check_folder(file.parent)
        return [(str(what), file)]
    missions = sorted(Path(what).glob("*.yaml")) if Path(what).is_dir() else []
    if not missions:
        raise UnreadableFileError(f"--all {what}: is no folder with missions (*.yaml)")
    for mission in missions:
        _plannable(str(mission))  # every mistake before the first hour of work
    taken = any_of(*(f"{glob.escape(mission.stem)}.npz" for mission in missions))
    target = output_path(out, Path("plans"), taken, overwrite=overwrite)
    check_folder(target)
    return [(str(mission), target / f"{mission.stem}.npz") for mission in missions]


def plan_files(
    targets: Sequence[tuple[str, Path]], options: PlanOptions, console: Console, *, profile: bool
) -> list[tuple[RunSummary, dict[str, Any]]]:
    """Plan missions, verify and write each; return summaries and extras.

    A plan that the verifier refuses is not written: its extra names no file. Ctrl-C ends the search for a plan: the
    best one so far is written, and no other mission is planned.

    Raises
    ------
    UserError
        No plan was found, or a file cannot be written.
    """
    results: list[tuple[RunSummary, dict[str, Any]]] = []
    for mission, file in targets:
        results.append(_plan(mission, file, options, console, profile=profile))
        if results[-1][1]["interrupted"]:
            break
    return results


def _plannable(name: str) -> Mission:
    mission = load_mission(name)
    require_double(mission)
    return mission


def _plan(
    name: str, file: Path, options: PlanOptions, console: Console, *, profile: bool
) -> tuple[RunSummary, dict[str, Any]]:
    mission = _plannable(name)
    begun = time.perf_counter()
    with _profiled(console, wanted=profile), ProgressLine() as line:

        def show(news: SearchNews) -> None:
            if news.result:
                line.say(news.result)
            line.show(news.state)

        line.begin(f"plans {mission.spec.name}", options.time_limit_s)
        trajectory = plan_mission(mission, options, on_progress=show)
    seconds = time.perf_counter() - begun
    report, own = check_trajectory(trajectory), tuple[Check, ...]()
    if options.extra is not None:
        from mpc_cover.planning.cvxpy_extra.checks import check_extra  # noqa: PLC0415 - CVXPY takes a second

        own = check_extra(trajectory, options.extra)
        report = Report((*report.checks, *own))
    summary = summarise(trajectory, report)
    if report.holds:
        save_trajectory(trajectory, file)
    meta = trajectory.meta
    console.print(
        f"J = {meta['cost_m']:.6g} m after {meta['subproblems']} subproblems from {meta['guess']}"
        f"{_by_whom(meta)}, "
        f"{seconds:.2f} s in all. {meta['stopped']}",
        highlight=False,
        soft_wrap=not console.is_terminal,
    )
    if (cvxpy := meta.get("cvxpy")) is not None:
        told = ", ".join(f"{count} {status}" for status, count in cvxpy["statuses"].items()) or "nothing to solve"
        worth = f"; the terms of {meta['extra']} are worth {meta['extra_value']:.4g}" if "extra" in meta else ""
        console.print(f"CVXPY ({cvxpy['solver']}): {told}{worth}", highlight=False, markup=False)
    for check in own:
        console.print(str(check), highlight=False, markup=False)
    kept = ("cost_m", "guess", "stopped", "subproblems", "kkt_residual", "qps", *(_OF_CVXPY if "cvxpy" in meta else ()))
    margins = {check.name: check.margin for check in report.checks if math.isfinite(check.margin)}
    extra = {"file": str(file) if report.holds else None, "computing_time_s": round(seconds, 3), "margins": margins}
    extra["interrupted"] = bool(meta.get("interrupted", False))
    extra |= {name: meta.get(name) for name in kept}
    return summary, extra


def _by_whom(meta: Mapping[str, Any]) -> str:
    """Return in words how many QPs of the search other back-ends answered than the chosen one; empty for none."""
    qps = meta["qps"]
    if not any(name != meta["backend"] for name in qps):
        return ""
    return " (QPs answered by " + ", ".join(f"{name}: {count}" for name, count in qps.items()) + ")"


@contextmanager
def _profiled(console: Console, *, wanted: bool) -> Iterator[None]:
    """Print where the time went, by own time."""
    if not wanted:
        yield
        return
    profiler = cProfile.Profile()
    with profiler:
        yield
    stats: dict[tuple[str, int, str], tuple[int, int, float, float, Any]] = pstats.Stats(profiler).stats  # type: ignore[attr-defined]
    total = sum(entry[2] for entry in stats.values())
    console.print(f"profile: {total:.2f} s in all, slowed by the profiler; own time, share, calls, function")
    for (path, _, function), (_, calls, own, _, _) in sorted(stats.items(), key=lambda item: -item[1][2])[:_PROFILED]:
        place = "/".join(Path(path).parts[-2:])
        console.print(f"{own:8.3f} s {own / total:6.1%} {calls:8d}  {place}:{function}", highlight=False, markup=False)
