"""The command line: argument parsing only. A user's mistake is one message and exit status 2."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from mpc_cover import cli_bench, cli_service, cli_size, cli_study, cli_swarm
from mpc_cover.cli_options import (
    Backend,
    Controller,
    FlightBackend,
    Json,
    Kill,
    MissionArgument,
    OptionalMission,
    RunOut,
    Seed,
    Speed,
    check_backend,
    check_seconds,
    check_speed,
    console_for,
    finish,
    flight_backend,
    load,
    print_json,
)
from mpc_cover.errors import UserError

USER_ERROR = 2
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
"""Our matrices are small: more threads only get in each other's way (set before numpy is imported)."""

app = typer.Typer(
    name="mpc-cover",
    help="Receding-horizon area coverage by a fleet of mobile sensors.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        from mpc_cover import __version__  # noqa: PLC0415 - every import here is one that agents need not wait for

        typer.echo(f"mpc-cover {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Receding-horizon area coverage by a fleet of mobile sensors."""


@app.command()
def demo(
    mission: OptionalMission = "box-3",
    out: RunOut = None,
    seed: Seed = 0,
    backend: FlightBackend = None,
    speed: Speed = 1.0,
    kill: Kill = None,
    controller: Controller = "mpc",
    as_json: Json = False,
) -> None:
    """Fly a mission with a controller and its agents as real processes over Zenoh on loopback."""
    from mpc_cover.service.run.demo import DemoOptions, run_demo  # noqa: PLC0415
    from mpc_cover.service.run.fault_injection import parse_kills  # noqa: PLC0415
    from mpc_cover.service.run.run_folder import RunFolder, default_folder  # noqa: PLC0415

    check_speed(speed)
    solver = flight_backend(backend, controller)
    loaded = load(mission)
    deaths = parse_kills(kill or [], loaded)
    potential = cli_swarm.flies_alone(controller, loaded)
    folder = RunFolder(out or default_folder(loaded), "demo", loaded)
    console = console_for(as_json=as_json)
    fleet = f"{loaded.fleet.size} agents, {loaded.field.size} cells"
    console.print(f"{loaded.spec.name}: {fleet}; run folder {folder.path}", highlight=False, markup=False)
    if potential:
        summary, extra, status = cli_swarm.demo(loaded, folder, console, seed=seed, speed=speed, deaths=deaths)
        finish(console, summary, extra, as_json=as_json, where=folder.path)
        raise typer.Exit(status)
    result = run_demo(loaded, DemoOptions(solver, seed, speed, deaths), folder, console)
    extra = {
        "folder": str(folder.path),
        "outcome": result.outcome,
        "controller_restarts": result.controller_restarts,
        "lost": list(result.lost),
        "exit_status": result.exit_status,
    }
    finish(console, result.summary, extra, as_json=as_json, where=folder.path)
    raise typer.Exit(result.exit_status)


@app.command()
def simulate(
    mission: MissionArgument,
    out: RunOut = None,
    seed: Seed = 0,
    backend: FlightBackend = None,
    kill: Kill = None,
    controller: Controller = "mpc",
    as_json: Json = False,
) -> None:
    """Fly the same closed loop in one process on a virtual clock: no network, the same result every time."""
    from mpc_cover.service.run.fault_injection import parse_kills  # noqa: PLC0415
    from mpc_cover.service.run.progress import Progress  # noqa: PLC0415
    from mpc_cover.service.run.run_folder import RunFolder, default_folder, step_times_of  # noqa: PLC0415
    from mpc_cover.service.run.simulate import simulate as run_simulation  # noqa: PLC0415

    solver = flight_backend(backend, controller)
    loaded = load(mission)
    deaths = parse_kills(kill or [], loaded)
    potential = cli_swarm.flies_alone(controller, loaded)
    folder = RunFolder(out or default_folder(loaded), "simulate", loaded)
    console = console_for(as_json=as_json)
    if potential:
        summary, extra, status = cli_swarm.simulate(loaded, folder, console, seed=seed, deaths=deaths)
        finish(console, summary, extra, as_json=as_json, where=folder.path)
        raise typer.Exit(status)
    with Progress(console) as progress:
        result = run_simulation(loaded, backend=solver, seed=seed, deaths=deaths, on_tick=progress.show)
    times = step_times_of([step.tick_time_s for step in result.steps if step.kind == "step"])
    console.print(result.outcome, highlight=False, markup=False, soft_wrap=True)
    ended = {"complete": result.complete, "outcome": result.outcome, "lost": list(result.lost)}
    summary = folder.write(result.trajectory, times, ended)
    extra = {"folder": str(folder.path), **ended}
    finish(console, summary, extra, as_json=as_json, where=folder.path)
    raise typer.Exit(0 if result.complete and summary.holds else 1)


@app.command()
def plan(
    mission: Annotated[
        str | None,
        typer.Argument(
            metavar="[MISSION]", help="A mission file (YAML), or the name of one that comes along; default box-3."
        ),
    ] = None,
    everything: Annotated[
        Path | None, typer.Option("--all", metavar="DIR", help="Plan every mission of a folder instead.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Trajectory file, or with --all the folder; default plan.npz, plans.")
    ] = None,
    starts: Annotated[int, typer.Option("--starts", min=1, max=1000, help="Guesses to tell apart.")] = 10,
    time_limit: Annotated[
        float | None, typer.Option("--time-limit", help="Seconds to search; whatever the limit, the result holds.")
    ] = None,
    min_time: Annotated[
        bool, typer.Option("--min-time", help="Search for the shortest plan that covers everything.")
    ] = False,
    cones: Annotated[
        str,
        typer.Option("--cones", help="Speeds, inputs, edges as polygons inside their discs, or exact, by cones."),
    ] = "polygons",
    profile: Annotated[bool, typer.Option("--profile", help="Show where the time goes.")] = False,
    seed: Seed = 0,
    backend: Backend = "piqp",
    as_json: Json = False,
) -> None:
    """Solve the optimal coverage NLP offline, over the mission's planning.duration_s."""
    from mpc_cover.planning.offline import PlanOptions  # noqa: PLC0415
    from mpc_cover.studies.plans import plan_files  # noqa: PLC0415

    check_backend(backend)
    if time_limit is not None:
        check_seconds("--time-limit", time_limit)
    if mission is not None and everything is not None:
        raise UserError(f"MISSION {mission} and --all {everything} are both given: plan one mission, or a folder")
    if cones not in {"polygons", "exact"}:
        raise UserError(f"--cones {cones}: must be polygons or exact")
    options = PlanOptions(backend, seed, starts, time_limit, min_time, cones == "exact")
    console, several = console_for(as_json=as_json), everything is not None
    results = plan_files(everything or mission or "box-3", out, options, console, folder=several, profile=profile)
    for summary, extra in results:
        finish(console, summary, extra, as_json=as_json and not several, where=Path(extra["file"]))
    if as_json and several:
        print_json({"plans": [{**summary.to_dict(), **extra} for summary, extra in results]})
    raise typer.Exit(0 if all(summary.holds for summary, _ in results) else 1)


@app.command()
def check(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A trajectory file, or a run folder.")],
    as_json: Json = False,
) -> None:
    """Verify a trajectory independently: what holds, and by what margin; exit status 0 if all does, else 1."""
    from mpc_cover.service.run.run_folder import find_trajectory  # noqa: PLC0415
    from mpc_cover.trajectory_file import load_trajectory  # noqa: PLC0415
    from mpc_cover.verification.check import check_trajectory  # noqa: PLC0415
    from mpc_cover.verification.summary import summarise  # noqa: PLC0415
    from mpc_cover.view.tables import print_report  # noqa: PLC0415

    trajectory = load_trajectory(find_trajectory(file))
    report = check_trajectory(trajectory)
    summary = summarise(trajectory, report)
    print_report(report, console_for(as_json=as_json), summary.information)
    if as_json:
        print_json({**report.to_dict(), "summary": summary.to_dict()})
    raise typer.Exit(0 if report.holds else 1)


@app.command()
def plot(
    path: Annotated[Path, typer.Argument(metavar="FILE|DIR", help="A trajectory file, or a run folder.")],
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for the PNGs; default the run folder, or FILE without .npz.")
    ] = None,
) -> None:
    """Draw a trajectory: paths over the coverage map, coverage, speeds, inputs, distances, step times."""
    from mpc_cover.service.run.run_folder import find_trajectory, read_step_times  # noqa: PLC0415
    from mpc_cover.trajectory_file import load_trajectory  # noqa: PLC0415
    from mpc_cover.verification.check import check_trajectory  # noqa: PLC0415
    from mpc_cover.view.figures import draw_run  # noqa: PLC0415

    file = find_trajectory(path)
    trajectory = load_trajectory(file)
    beside = path if path.is_dir() else file.with_suffix("")
    files = draw_run(trajectory, out or beside, read_step_times(file.parent), check_trajectory(trajectory))
    for drawn in files:
        typer.echo(drawn)


app.command()(cli_service.serve)
app.command()(cli_service.agent)
app.command()(cli_size.size)
app.add_typer(cli_bench.app)
app.add_typer(cli_study.app)


def main() -> None:
    """Run the command line; the entry point of `mpc-cover`."""
    try:
        app(prog_name="mpc-cover")
    except UserError as error:
        sys.stderr.write(f"mpc-cover: {error}\n")
        sys.exit(USER_ERROR)
