"""`mpc-cover bench`: benchmarks of the planner, against general-purpose solvers and part by part."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads the annotations
from typing import Annotated

import typer

from mpc_cover.cli.options import (
    Backend,
    CpuTime,
    Json,
    OptionalMission,
    Overwrite,
    check_backend,
    check_seconds,
    console_for,
    load,
    print_json,
)
from mpc_cover.errors import UserError
from mpc_cover.output import any_of, check_folder, output_path

app = typer.Typer(
    name="bench",
    help="Measure the planner: against general-purpose solvers, and part by part.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

MOST_STEPS = 100_000


@app.command()
def planner(
    mission: OptionalMission = "box-3",
    guess: Annotated[str, typer.Option("--guess", help="Start from boustrophedon, rest, or all of them.")] = "all",
    peers: Annotated[
        str | None, typer.Option("--peers", metavar="NAME,...", help="Only these; a wrong name lists all there are.")
    ] = None,
    time_limit: Annotated[float, typer.Option("--time-limit", help="How long each may solve [s].")] = 60.0,
    cpu_time: CpuTime = False,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder for bench.json, bench.csv and figures.")
    ] = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Solve a mission with our planner and with general-purpose solvers, each judged by the same verifier."""
    from mpc_cover.control.factory import require_double  # noqa: PLC0415 - --help needs none of these
    from mpc_cover.studies import benchmark  # noqa: PLC0415
    from mpc_cover.studies.race import Limit  # noqa: PLC0415
    from mpc_cover.studies.verdict import TOLERANCE  # noqa: PLC0415
    from mpc_cover.view.benchmark import print_benchmark  # noqa: PLC0415
    from mpc_cover.view.progress import ProgressLine  # noqa: PLC0415

    check_seconds("--time-limit", time_limit)
    loaded, console, limit = load(mission), console_for(as_json=as_json), Limit(time_limit, cpu_time)
    require_double(loaded)  # the planner cannot plan for single integrators
    if out is not None:
        check_folder(output_path(out, out, any_of("bench.json", "bench.csv", "bench-*.png"), overwrite=overwrite))
    with ProgressLine() as line:
        races = benchmark.run_benchmark(loaded, guess, peers, limit, benchmark.RaceProgress(line, limit))
    for race in races:
        before = f"guess: J = {race.before.cost:.4g} m, {race.before.covered_percent:.2f} % covered"
        title = f"{loaded.spec.name} from {race.guess} ({before}); violations up to {TOLERANCE:g} are forgiven"
        title += "; processor time" if cpu_time else ""
        print_benchmark(benchmark.rows_of(race), title, console)
    if out is not None:
        for file in benchmark.write_benchmark(out, loaded, races, limit):
            console.print(str(file), highlight=False, markup=False, soft_wrap=True)
    if as_json:
        print_json(benchmark.as_dict(loaded, races, limit))


@app.command()
def step(
    mission: OptionalMission = "box-3",
    backend: Backend = "native",
    as_json: Json = False,
) -> None:
    """Fly a mission in closed loop and show where the milliseconds of a control step go."""
    from mpc_cover.control.factory import require_double  # noqa: PLC0415
    from mpc_cover.studies.step_profile import profile_steps  # noqa: PLC0415
    from mpc_cover.view.benchmark import print_steps  # noqa: PLC0415
    from mpc_cover.view.progress import ProgressLine  # noqa: PLC0415

    check_backend(backend)
    loaded, console = load(mission), console_for(as_json=as_json)
    require_double(loaded)
    with ProgressLine() as line:
        line.begin(f"flies {loaded.spec.name}")
        line.show("plans before the start")
        parts = profile_steps(loaded, backend, lambda part: line.show(f"{100.0 * part:.1f} % covered", part))
    print_steps(parts, f"{loaded.spec.name}, {backend}: one control step", console)
    if as_json:
        names = ("median_ms", "p99_ms", "share")
        print_json({name: dict(zip(names, values, strict=True)) for name, values in parts.items()})


@app.command()
def maps(
    steps: Annotated[int, typer.Option("--steps", help="Steps of each map.")] = 200,
    cpu_time: CpuTime = False,
    as_json: Json = False,
) -> None:
    """Measure a step of the information maps: 100,489 cells, 50 agents, two densities of cells."""
    from mpc_cover.studies.map_timing import AGENTS, ROWS, measure_maps  # noqa: PLC0415
    from mpc_cover.view.benchmark import print_maps  # noqa: PLC0415
    from mpc_cover.view.progress import ProgressLine  # noqa: PLC0415

    if not 1 <= steps <= MOST_STEPS:
        raise UserError(f"--steps {steps}: must be from 1 to {MOST_STEPS}")
    console = console_for(as_json=as_json)
    with ProgressLine() as line:
        line.begin("measures maps")
        rows = measure_maps(steps, cpu_time=cpu_time, on_progress=line.show)
    title = f"{ROWS**2} cells, {AGENTS} agents: a step of the map, its gamma included"
    print_maps(rows, title + ("; processor time" if cpu_time else ""), console)
    if as_json:
        print_json({"cells": ROWS**2, "agents": AGENTS, "maps": rows})
