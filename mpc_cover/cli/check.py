"""`mpc-cover check`: verifies a trajectory."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads the annotations
from typing import TYPE_CHECKING, Annotated

import typer

from mpc_cover.cli.options import ExtraOption, Json, console_for, load, load_extra_option, print_json
from mpc_cover.errors import UserError
from mpc_cover.exit_status import exit_status

if TYPE_CHECKING:
    from rich.console import Console

    from mpc_cover.mission.load import Mission
    from mpc_cover.trajectory_file import Recording

_SHOWN = 8
"""Differences of missions that are printed; a plain choice."""


def check(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A trajectory file, or a run folder.")],
    mission: Annotated[
        str | None,
        typer.Option("--mission", metavar="MISSION", help="What to judge by, instead of the mission that FILE holds."),
    ] = None,
    extra: ExtraOption = None,
    as_json: Json = False,
) -> None:
    """Verify a trajectory independently: what holds, and by what margin; with --extra, your constraints as well.

    A file holds the mission that it was flown for, and whoever edits the one may edit the other: with --mission it is
    judged by yours, and every difference is said.

    Exit status 0 if all does and everything is covered, else 1.
    """
    from mpc_cover.service.run.run_folder import find_trajectory  # noqa: PLC0415 - --help needs none of these
    from mpc_cover.service.run.sources import check_sources  # noqa: PLC0415
    from mpc_cover.trajectory_file import load_trajectory  # noqa: PLC0415
    from mpc_cover.verification.check import check_trajectory  # noqa: PLC0415
    from mpc_cover.verification.judged import differences, judged_by  # noqa: PLC0415
    from mpc_cover.verification.report import Report  # noqa: PLC0415
    from mpc_cover.verification.summary import summarise  # noqa: PLC0415
    from mpc_cover.view.progress import ProgressLine  # noqa: PLC0415
    from mpc_cover.view.tables import print_area_seen, print_report  # noqa: PLC0415

    given = None if mission is None else load(mission)
    held = load_trajectory(find_trajectory(file))
    trajectory = held if given is None else judged_by(held, given)
    differs = [] if given is None else differences(held.mission, given)
    console = console_for(as_json=as_json)
    with ProgressLine() as line:
        line.begin(f"verifies {file}")
        report = check_trajectory(held, given)
    if (sources := check_sources(held, find_trajectory(file).parent)) is not None:
        report = Report((*report.checks, sources))
    if (own := load_extra_option(extra)) is not None:
        from mpc_cover.planning.cvxpy_extra.checks import with_extra  # noqa: PLC0415 - CVXPY takes a second

        report = with_extra(report, trajectory, own)
    elif isinstance(made_with := trajectory.meta.get("extra"), str):
        hint = f"planned with --extra {made_with}, which is not looked at: give it to have it checked, too"
        console.print(hint, highlight=False, markup=False)
    _say_by_what(console, held, mission, differs, find_trajectory(file).with_name("mission.json"))
    summary = summarise(trajectory, report)
    print_report(report, console, summary.information)
    print_area_seen(summary, console)
    if as_json:
        judged = {"mission": mission or f"{held.mission.spec.name} of the file", "differences": differs}
        print_json({**report.to_dict(), "judged_by": judged, "summary": summary.to_dict()})
    raise typer.Exit(exit_status(holds=report.holds, covered=summary.covered_cells == summary.cells))


def _say_by_what(console: Console, held: Recording, mission: str | None, differs: list[str], beside: Path) -> None:
    """Say as what a recording is judged, and by which mission; how that of its file differs, and one `beside` it."""
    from mpc_cover.trajectory_file import RecordingKind  # noqa: PLC0415 - --help needs none of these

    what = "plan" if held.meta.get("kind") == RecordingKind.PLAN else "flight"
    if mission is None:
        other = _other_version(held.mission, beside)
        hint = "" if other is None else f"; {other}: --mission judges by that one"
        text = f"judged as a {what} by the mission that the file holds, {held.mission.spec.name}{hint}"
        console.print(text, highlight=False, markup=False, soft_wrap=True)
        return
    console.print(f"judged as a {what} by mission {mission}", highlight=False, markup=False, soft_wrap=True)
    if not differs:
        return
    more = f"; and {len(differs) - _SHOWN} more" if len(differs) > _SHOWN else ""
    text = f"the mission in the file differs: {'; '.join(differs[:_SHOWN])}{more}"
    console.print(text, style="yellow", highlight=False, markup=False, soft_wrap=True)


def _other_version(held: Mission, beside: Path) -> str | None:
    """Return a warning where a mission of this name is recorded beside the run or comes along, and is another one."""
    from mpc_cover.mission.load import load_mission, shipped_missions  # noqa: PLC0415 - --help needs none of these
    from mpc_cover.verification.judged import differences  # noqa: PLC0415

    places = {beside: f"that in {beside}"} if beside.is_file() else {}
    places |= {path: "the one that comes along" for path in shipped_missions() if path.stem == held.spec.name}
    for path, which in places.items():
        try:
            differs = differences(held, load_mission(path))
        except UserError:
            continue
        if differs:
            return f"{which} differs in {differs[0].split(':', 1)[0]}"
    return None
