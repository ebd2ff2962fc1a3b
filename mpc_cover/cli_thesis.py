"""`mpc-cover study thesis` and `mpc-cover study laws`: argument parsing only."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path  # noqa: TC003 - typer reads the annotations
from typing import Annotated

import typer

from mpc_cover.cli_options import Backend, Jobs, Json, Missions, check_backend, console_for, cores, print_json


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
    as_json: Json = False,
) -> None:
    """Draw every figure of the thesis as ours, on one page, each with the command that made it.

    A study that was stopped goes on where it was. Exit status 1 when something is not as the thesis says.
    """
    from mpc_cover.studies.thesis_study import ThesisOptions, run_thesis  # noqa: PLC0415 - --help need not wait for it

    console = console_for(as_json=as_json)
    options = ThesisOptions(seed, seeds, tuple(only or ()), jobs or cores())
    result = run_thesis(out, options, console, shlex.join(["mpc-cover", *sys.argv[1:]]))
    for problem in result.problems:
        console.print(problem, style="bold red", highlight=False, markup=False)
    console.print(f"written to {result.page}", highlight=False, markup=False, soft_wrap=True)
    if as_json:
        print_json(result.to_dict())
    raise typer.Exit(result.exit_status)


def laws(
    missions: Missions,
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder for laws.csv and laws.json.")] = None,
    seeds: Annotated[int, typer.Option("--seeds", min=1, max=10_000, help="How many seeds, from 0 on.")] = 3,
    starts: Annotated[str, typer.Option("--starts", help="random: drawn for each seed; mission: its own.")] = "random",
    backend: Backend = "piqp",
    jobs: Jobs = None,
    as_json: Json = False,
) -> None:
    """Compare the receding horizon and the potential law on equal dynamics: time, distance, effort, traffic, computing.

    Exit status 1 when a flight was not completed, or a check of the independent verifier fails.
    """
    from mpc_cover.studies.laws import LawsOptions, run_laws  # noqa: PLC0415 - --help need not wait for it

    check_backend(backend)
    options = LawsOptions(tuple(missions), seeds, starts, backend, jobs or cores())
    runs = run_laws(options, out, console_for(as_json=as_json))
    if as_json:
        from msgspec.structs import asdict  # noqa: PLC0415

        print_json({"runs": [asdict(run) for run in runs]})
    raise typer.Exit(0 if all(run.complete and run.violations == 0 for run in runs) else 1)
