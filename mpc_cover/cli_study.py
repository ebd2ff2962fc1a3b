"""`mpc-cover study`: argument parsing only."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path  # noqa: TC003 - typer reads the annotations
from typing import Annotated

import typer

from mpc_cover import cli_thesis
from mpc_cover.cli_options import Jobs, Json, Missions, console_for, cores, print_json
from mpc_cover.errors import UserError

app = typer.Typer(
    name="study",
    help="Studies of the closed loop: many flights, measured alike.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


app.command()(cli_thesis.thesis)
app.command()(cli_thesis.laws)


@app.callback()
def _root() -> None:
    """Studies of the closed loop: many flights, measured alike."""


@app.command()
def horizon(
    missions: Missions,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the results; may hold earlier ones.")],
    horizons: Annotated[
        str, typer.Option("--horizons", help="Horizons in steps, or in seconds with an s: 4,8,12s.")
    ] = "4,8,16,24,32",
    periods: Annotated[
        str | None, typer.Option("--periods", help="Control periods in seconds; default each mission's own.")
    ] = None,
    seeds: Annotated[int, typer.Option("--seeds", help="How many seeds, from 0 on.")] = 20,
    backends: Annotated[str, typer.Option("--backends", help="QP back-ends: piqp, clarabel, osqp.")] = "piqp",
    controllers: Annotated[str, typer.Option("--controllers", help="Among mpc, sweep, potential.")] = "mpc",
    starts: Annotated[
        str, typer.Option("--starts", help="random: drawn for each seed; mission: the mission's.")
    ] = "random",
    jobs: Jobs = None,
    dask: Annotated[
        str | None, typer.Option("--dask", metavar="ADDRESS", help="Fly on a Dask cluster, as tcp://host:8786.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Fly missions over and over, from random starts, with different horizons, and compare.

    A study that was stopped goes on where it was; changed options add runs to the folder's others.
    """
    from mpc_cover.studies.executors import DaskExecutor, LocalExecutor  # noqa: PLC0415 - --help need not wait for these
    from mpc_cover.studies.grid import Grid  # noqa: PLC0415
    from mpc_cover.studies.horizon import run_study  # noqa: PLC0415

    if dask is not None and jobs is not None:
        raise UserError("--jobs and --dask are both given: the cluster has its own number of jobs")
    grid = Grid(
        missions=missions,
        horizons=_listed(horizons),
        periods=_seconds(periods),
        seeds=seeds,
        backends=_listed(backends),
        controllers=_listed(controllers),
        starts=starts,
    )
    crew = DaskExecutor(dask) if dask is not None else LocalExecutor(jobs or cores())
    command = shlex.join(["mpc-cover", *sys.argv[1:]])
    result = run_study(grid, out, crew, console_for(as_json=as_json), command=command)
    if as_json:
        print_json({"folder": str(out), **result.to_dict()})
    raise typer.Exit(result.exit_status)


def _listed(text: str) -> list[str]:
    """Return the parts of a list with commas; none of an empty text."""
    return [part.strip() for part in text.split(",") if part.strip()]


def _seconds(text: str | None) -> list[float]:
    """Return the periods [s]; none for each mission's own."""
    if text is None:
        return []
    parts = _listed(text)
    if not parts:
        raise UserError("--periods: is empty: give one or more, separated by commas, or leave it out")
    try:
        return [float(part.removesuffix("s")) for part in parts]
    except ValueError:
        raise UserError(f"--periods {text}: must be numbers of seconds, separated by commas") from None
