"""`mpc-cover check`: verifies a trajectory."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads the annotations
from typing import Annotated

import typer

from mpc_cover.cli.options import ExtraOption, Json, console_for, load_extra_option, print_json
from mpc_cover.exit_status import exit_status


def check(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A trajectory file, or a run folder.")],
    extra: ExtraOption = None,
    as_json: Json = False,
) -> None:
    """Verify a trajectory independently: what holds, and by what margin; with --extra, your constraints as well.

    Exit status 0 if all does and everything is covered, else 1.
    """
    from mpc_cover.service.run.run_folder import find_trajectory  # noqa: PLC0415 - --help needs none of these
    from mpc_cover.trajectory_file import load_trajectory  # noqa: PLC0415
    from mpc_cover.verification.check import check_trajectory  # noqa: PLC0415
    from mpc_cover.verification.summary import summarise  # noqa: PLC0415
    from mpc_cover.view.progress import ProgressLine  # noqa: PLC0415
    from mpc_cover.view.tables import print_area_seen, print_report  # noqa: PLC0415

    trajectory = load_trajectory(find_trajectory(file))
    console = console_for(as_json=as_json)
    with ProgressLine() as line:
        line.begin(f"verifies {file}")
        report = check_trajectory(trajectory)
    if (own := load_extra_option(extra)) is not None:
        from mpc_cover.planning.cvxpy_extra.checks import with_extra  # noqa: PLC0415 - CVXPY takes a second

        report = with_extra(report, trajectory, own)
    elif isinstance(made_with := trajectory.meta.get("extra"), str):
        hint = f"planned with --extra {made_with}, which is not looked at: give it to have it checked, too"
        console.print(hint, highlight=False, markup=False)
    summary = summarise(trajectory, report)
    print_report(report, console, summary.information)
    print_area_seen(summary, console)
    if as_json:
        print_json({**report.to_dict(), "summary": summary.to_dict()})
    raise typer.Exit(exit_status(holds=report.holds, covered=summary.covered_cells == summary.cells))
