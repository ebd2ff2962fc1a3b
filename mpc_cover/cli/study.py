"""`mpc-cover study`: studies of many flights, measured alike."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path  # noqa: TC003 - typer reads the annotations
from typing import Annotated

import typer

from mpc_cover.cli.options import (
    Backend,
    Jobs,
    Json,
    Missions,
    Overwrite,
    check_backend,
    console_for,
    cores,
    print_json,
)
from mpc_cover.errors import UserError
from mpc_cover.exit_status import exit_status

app = typer.Typer(
    name="study",
    help="Studies of the closed loop: many flights, measured alike.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


@app.callback()
def _root() -> None:
    """Studies of the closed loop: many flights, measured alike."""


@app.command()
def thesis(
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of the page; may hold earlier parts of it.")
    ],
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="FIGURE", help="A figure as 6.2, or a mission; repeatable.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the flights and plans that are drawn.")] = 1,
    seeds: Annotated[
        int, typer.Option("--seeds", min=0, max=100_000, help="Fly chapters 5 and 6 from so many random starts, too.")
    ] = 0,
    jobs: Jobs = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Draw every figure of the thesis as ours, on one page, each with the command that made it.

    A study that was stopped goes on where it was. Exit status 1 when something is not as the thesis says.
    """
    from mpc_cover.studies.thesis_study import ThesisOptions, run_thesis  # noqa: PLC0415 - --help need not wait for it

    console = console_for(as_json=as_json)
    options = ThesisOptions(seed, seeds, tuple(only or ()), jobs or cores(), overwrite)
    result = run_thesis(out, options, console, shlex.join(["mpc-cover", *sys.argv[1:]]))
    for problem in result.problems:
        console.print(problem, style="bold red", highlight=False, markup=False)
    console.print(f"written to {result.page}", highlight=False, markup=False, soft_wrap=True)
    if as_json:
        print_json(result.to_dict())
    raise typer.Exit(result.exit_status)


@app.command()
def laws(
    missions: Missions,
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder for laws.csv and laws.json.")] = None,
    seeds: Annotated[int, typer.Option("--seeds", min=1, max=10_000, help="How many seeds, from 0 on.")] = 3,
    starts: Annotated[str, typer.Option("--starts", help="random: drawn for each seed; mission: its own.")] = "random",
    backend: Backend = "native",
    jobs: Jobs = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Compare the receding horizon and the potential law on equal dynamics: time, distance, effort, traffic, computing.

    Exit status 1 when a flight was not completed, or a check of the independent verifier fails.
    """
    from mpc_cover.studies.laws import LawsOptions, run_laws  # noqa: PLC0415 - --help need not wait for it

    check_backend(backend)
    options = LawsOptions(tuple(missions), seeds, starts, backend, jobs or cores(), overwrite)
    runs = run_laws(options, out, console_for(as_json=as_json))
    if as_json:
        from msgspec.structs import asdict  # noqa: PLC0415

        print_json({"runs": [asdict(run) for run in runs]})
    holds, covered = all(run.violations == 0 for run in runs), all(run.complete for run in runs)
    raise typer.Exit(exit_status(holds=holds, covered=covered))


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
    backends: Annotated[str, typer.Option("--backends", help="Solvers: native, piqp, clarabel, osqp.")] = "native",
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
    executor = DaskExecutor(dask) if dask is not None else LocalExecutor(jobs or cores())
    command = shlex.join(["mpc-cover", *sys.argv[1:]])
    result = run_study(grid, out, executor, console_for(as_json=as_json), command=command)
    if as_json:
        print_json({"folder": str(out), **result.to_dict()})
    raise typer.Exit(result.exit_status)


@app.command()
def robustness(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the results; may hold earlier ones.")],
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="NAME", help="A row or column of the table; repeatable.")
    ] = None,
    jobs: Jobs = None,
    as_json: Json = False,
) -> None:
    """Fly small missions of every shape as they are, moved, scaled, turned, renumbered, sampled otherwise, and crowds.

    Prints the worst time to 99 % over the bound for each kind. A study that was stopped goes on where it was. Exit
    status 1 when a flight is not completed, violates a check, or takes more than twice the bound.
    """
    from mpc_cover.studies.executors import LocalExecutor  # noqa: PLC0415 - --help need not wait for these
    from mpc_cover.studies.robustness import run_robustness  # noqa: PLC0415

    command = shlex.join(["mpc-cover", *sys.argv[1:]])
    executor = LocalExecutor(jobs or cores())
    study = run_robustness(tuple(only or ()), out, executor, console_for(as_json=as_json), command=command)
    if as_json:
        print_json({"folder": str(out), **study.to_dict()})
    raise typer.Exit(study.exit_status)


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
