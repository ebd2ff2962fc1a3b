"""`mpc-cover plot`: figures of a trajectory."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads the annotations
from typing import Annotated

import typer

from mpc_cover.cli.options import Overwrite  # noqa: TC001 - typer reads the annotations
from mpc_cover.output import any_of, output_path


def plot(
    path: Annotated[Path, typer.Argument(metavar="FILE|DIR", help="A trajectory file, or a run folder.")],
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for the PNGs; default DIR/plot, or FILE without .npz.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Draw a trajectory: paths over the coverage map, coverage, speeds, inputs, distances, step times."""
    from mpc_cover.service.run.run_folder import find_trajectory, read_step_times  # noqa: PLC0415 - --help waits for none
    from mpc_cover.trajectory_file import load_trajectory  # noqa: PLC0415
    from mpc_cover.verification.check import check_trajectory  # noqa: PLC0415
    from mpc_cover.view.figures import FIGURES, draw_run  # noqa: PLC0415
    from mpc_cover.view.progress import ProgressLine  # noqa: PLC0415

    file = find_trajectory(path)
    trajectory = load_trajectory(file)
    beside = path / "plot" if path.is_dir() else file.with_suffix("")
    folder = output_path(out, beside, any_of(*FIGURES), overwrite=overwrite)
    step_times = read_step_times(file.parent)
    with ProgressLine() as line:
        line.begin(f"verifies and draws {file}")
        files = draw_run(trajectory, folder, step_times, check_trajectory(trajectory))
    for drawn in files:
        typer.echo(drawn)
