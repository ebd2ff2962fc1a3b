"""`mpc-cover bench`: argument parsing only."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path  # noqa: TC003 - typer reads the annotations
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mpc_cover.errors import UserError

if TYPE_CHECKING:
    from rich.console import Console

    from mpc_cover.studies.race import Run

app = typer.Typer(
    name="bench",
    help="Measure the planner: against general-purpose solvers, and part by part.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

MOST_STEPS = 100_000

Mission = Annotated[
    str, typer.Argument(metavar="[MISSION]", help="A mission file (YAML), or the name of one that comes along.")
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON report on stdout, all else on stderr.")]


@app.command()
def planner(
    mission: Mission = "box-3",
    guess: Annotated[str, typer.Option("--guess", help="Start from boustrophedon, rest, or all of them.")] = "all",
    peers: Annotated[
        str | None, typer.Option("--peers", metavar="NAME,...", help="Only these; a wrong name lists all there are.")
    ] = None,
    time_limit: Annotated[float, typer.Option("--time-limit", help="Seconds that each may solve.")] = 60.0,
    cpu_time: Annotated[
        bool, typer.Option("--cpu-time", help="Measure processor time, on a machine with other work to do.")
    ] = False,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for bench.json, bench.csv and figures.")] = None,
    as_json: Json = False,
) -> None:
    """Solve a mission with our planner and with general-purpose solvers, each judged by the same verifier."""
    from mpc_cover.mission.load import load_mission  # noqa: PLC0415 - --help needs none of these
    from mpc_cover.studies import benchmark  # noqa: PLC0415
    from mpc_cover.studies.race import Limit  # noqa: PLC0415
    from mpc_cover.studies.verdict import TOLERANCE  # noqa: PLC0415
    from mpc_cover.view.benchmark import print_benchmark  # noqa: PLC0415

    if not math.isfinite(time_limit) or time_limit <= 0.0:
        raise UserError(f"--time-limit {time_limit:g}: must be a number of seconds greater than 0")
    loaded, console, limit = load_mission(mission), _console(as_json), Limit(time_limit, cpu_time)
    if out is not None:
        benchmark.check_folder(out)
    with console.status("starting") as status:

        def told(name: str, run: Run) -> None:
            best = f"J = {run.best.verdict.cost:.4g} m" if run.best is not None else "no iterate yet"
            status.update(f"from {name}: {run.name}, {run.time_s:.1f} s, {best}")

        races = benchmark.run_benchmark(loaded, guess, peers, limit, told)
    for race in races:
        before = f"guess: J = {race.before.cost:.4g} m, {race.before.covered_percent:.2f} % covered"
        title = f"{loaded.spec.name} from {race.guess} ({before}); violations up to {TOLERANCE:g} are forgiven"
        title += "; processor time" if cpu_time else ""
        print_benchmark(benchmark.rows_of(race), title, console)
    if out is not None:
        for file in benchmark.write_benchmark(out, loaded, races, limit):
            console.print(str(file), highlight=False, markup=False, soft_wrap=True)
    if as_json:
        _print_json(benchmark.as_dict(loaded, races, limit))


@app.command()
def step(
    mission: Mission = "box-3",
    backend: Annotated[
        str, typer.Option("--backend", metavar="NAME", help="QP back-end: piqp, clarabel or osqp.")
    ] = "piqp",
    as_json: Json = False,
) -> None:
    """Fly a mission in closed loop and say where the milliseconds of a control step go."""
    from mpc_cover.mission.load import load_mission  # noqa: PLC0415
    from mpc_cover.studies.step_profile import profile_steps  # noqa: PLC0415
    from mpc_cover.view.benchmark import print_steps  # noqa: PLC0415

    loaded, console = load_mission(mission), _console(as_json)
    with console.status("planning") as status:
        parts = profile_steps(loaded, backend, lambda part: status.update(f"flying: {100.0 * part:.1f} % covered"))
    print_steps(parts, f"{loaded.spec.name}, {backend}: one control step", console)
    if as_json:
        names = ("median_ms", "p99_ms", "share")
        _print_json({name: dict(zip(names, values, strict=True)) for name, values in parts.items()})


@app.command()
def maps(
    steps: Annotated[int, typer.Option("--steps", help="Steps of each map.")] = 200,
    cpu_time: Annotated[
        bool, typer.Option("--cpu-time", help="Measure processor time, on a machine with other work to do.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Measure a step of the information maps: 100,489 cells, 50 agents, two densities of cells."""
    from mpc_cover.studies.map_timing import AGENTS, ROWS, measure_maps  # noqa: PLC0415
    from mpc_cover.view.benchmark import print_maps  # noqa: PLC0415

    if not 1 <= steps <= MOST_STEPS:
        raise UserError(f"--steps {steps}: must be from 1 to {MOST_STEPS}")
    console = _console(as_json)
    with console.status("measuring"):
        rows = measure_maps(steps, cpu_time=cpu_time)
    title = f"{ROWS**2} cells, {AGENTS} agents: a step of the map, its gamma included"
    print_maps(rows, title + ("; processor time" if cpu_time else ""), console)
    if as_json:
        _print_json({"cells": ROWS**2, "agents": AGENTS, "maps": rows})


def _console(as_json: bool) -> Console:
    from rich.console import Console  # noqa: PLC0415

    return Console(stderr=as_json)


def _print_json(data: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(data, allow_nan=False) + "\n")
