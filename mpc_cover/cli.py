"""The command line: argument parsing only. A user's mistake is one message and exit status 2."""

from __future__ import annotations

import json
import math
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mpc_cover import cli_bench, cli_size, cli_study, cli_swarm
from mpc_cover.errors import UserError

if TYPE_CHECKING:
    from rich.console import Console

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.network import NetworkOptions

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
app.add_typer(cli_bench.app)
app.add_typer(cli_study.app)
app.command()(cli_size.size)

MissionArgument = Annotated[
    str, typer.Argument(metavar="MISSION", help="A mission file (YAML), or the name of one that comes along, as box-3.")
]
OptionalMission = Annotated[
    str, typer.Argument(metavar="MISSION", help="A mission file (YAML), or the name of one that comes along.")
]
Backend = Annotated[str, typer.Option("--backend", metavar="NAME", help="QP back-end: piqp, clarabel or osqp.")]
Controller = Annotated[
    str, typer.Option("--controller", metavar="NAME", help="mpc, or potential: no controller, each agent by itself.")
]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of whatever is random.")]
Speed = Annotated[float, typer.Option("--speed", help="Mission seconds that pass in a second; the same for all.")]
Out = Annotated[Path | None, typer.Option("--out", help="Run folder; default runs/MISSION-TIME.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON summary on stdout, all else on stderr.")]
Connect = Annotated[
    list[str] | None, typer.Option("-e", "--connect", metavar="ENDPOINT", help="Zenoh endpoint to connect to.")
]
Listen = Annotated[
    list[str] | None, typer.Option("-l", "--listen", metavar="ENDPOINT", help="Zenoh endpoint to listen on.")
]
Config = Annotated[Path | None, typer.Option("--config", metavar="FILE", help="Zenoh configuration, JSON5.")]
Timeout = Annotated[
    float, typer.Option("--connect-timeout", help="How long to wait for endpoints to be reachable [s].")
]
WithParent = Annotated[bool, typer.Option("--with-parent", hidden=True, help="End when standard input ends.")]
Kill = Annotated[
    list[str] | None,
    typer.Option("--kill", metavar="AGENT@SECONDS", help="Let an agent die at a mission time; may be repeated."),
]
StepLog = Annotated[Path | None, typer.Option("--step-log", hidden=True, help="Append each step's figures here.")]


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
    out: Out = None,
    seed: Seed = 0,
    backend: Backend = "piqp",
    speed: Speed = 1.0,
    kill: Kill = None,
    controller: Controller = "mpc",
    as_json: Json = False,
) -> None:
    """Fly a mission with a controller and its agents as real processes over Zenoh on loopback."""
    from mpc_cover.service.demo import DemoOptions, run_demo  # noqa: PLC0415
    from mpc_cover.service.kills import parse_kills  # noqa: PLC0415
    from mpc_cover.service.run_folder import RunFolder, default_folder  # noqa: PLC0415

    _check_speed(speed)
    _check_backend(backend)
    loaded = _load(mission)
    deaths = parse_kills(kill or [], loaded)
    potential = cli_swarm.flies_alone(controller, loaded)
    folder = RunFolder(out or default_folder(loaded), "demo", loaded)
    console = _console(as_json)
    fleet = f"{loaded.fleet.size} agents, {loaded.field.size} cells"
    console.print(f"{loaded.spec.name}: {fleet}; run folder {folder.path}", highlight=False, markup=False)
    if potential:
        summary, extra, status = cli_swarm.demo(loaded, folder, console, seed=seed, speed=speed, deaths=deaths)
        _finish(console, summary, extra, as_json, where=folder.path)
        raise typer.Exit(status)
    result = run_demo(loaded, DemoOptions(backend, seed, speed, deaths), folder, console)
    extra = {
        "folder": str(folder.path),
        "outcome": result.outcome,
        "controller_restarts": result.controller_restarts,
        "lost": list(result.lost),
        "exit_status": result.exit_status,
    }
    _finish(console, result.summary, extra, as_json, where=folder.path)
    raise typer.Exit(result.exit_status)


@app.command()
def serve(
    mission: MissionArgument,
    connect: Connect = None,
    listen: Listen = None,
    config: Config = None,
    connect_timeout: Timeout = 10.0,
    state_dir: Annotated[
        Path | None, typer.Option("--state-dir", help="Where checkpoints are kept; default .mpc-cover/MISSION.")
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Start afresh, whatever the checkpoint says.")] = False,
    stay: Annotated[bool, typer.Option("--stay", help="Go on answering after the mission is complete.")] = False,
    seed: Seed = 0,
    backend: Backend = "piqp",
    speed: Speed = 1.0,
    step_log: StepLog = None,
    with_parent: WithParent = False,
) -> None:
    """Control a mission: wait for its agents, plan, and send them plans until everything is covered."""
    from mpc_cover.service.network import DEFAULT_ENDPOINT  # noqa: PLC0415
    from mpc_cover.service.serving import ServeOptions  # noqa: PLC0415
    from mpc_cover.service.serving import serve as run_serve  # noqa: PLC0415

    _check_speed(speed)
    _check_backend(backend)
    loaded = _load(mission)
    network = _network(connect, listen, config, connect_timeout, default_listen=DEFAULT_ENDPOINT)
    options = ServeOptions(backend, seed, speed, state_dir, fresh, stay, step_log, with_parent)
    raise typer.Exit(run_serve(loaded, options, network))


@app.command()
def agent(
    mission: MissionArgument,
    agent_id: Annotated[str, typer.Option("--id", help="Which of the mission's agents to be.")],
    connect: Connect = None,
    listen: Listen = None,
    config: Config = None,
    connect_timeout: Timeout = 10.0,
    record: Annotated[Path | None, typer.Option("--record", help="Write the exact motion here.")] = None,
    seed: Seed = 0,
    speed: Speed = 1.0,
    controller: Controller = "mpc",
    with_parent: WithParent = False,
) -> None:
    """Be one simulated agent: fly the plans that come, each to its end at rest, until a signal comes.

    With --controller potential no plans come: it flies by the potential law on what it hears from the others, and ends
    when all know that everything is covered. Without endpoints the agents of a mission find each other on loopback.
    """
    from mpc_cover.service.network import DEFAULT_ENDPOINT  # noqa: PLC0415
    from mpc_cover.service.serving import AgentOptions, fly  # noqa: PLC0415

    _check_speed(speed)
    loaded = _load(mission)
    if cli_swarm.flies_alone(controller, loaded):
        from mpc_cover.service.swarm_serving import fly_alone  # noqa: PLC0415

        options = AgentOptions(speed, record, with_parent, seed)
        network = _network(connect, listen, config, connect_timeout)
        raise typer.Exit(fly_alone(loaded, agent_id, options, network))
    network = _network(connect, listen, config, connect_timeout, default_connect=DEFAULT_ENDPOINT)
    raise typer.Exit(fly(loaded, agent_id, AgentOptions(speed, record, with_parent, seed), network))


@app.command()
def simulate(
    mission: MissionArgument,
    out: Out = None,
    seed: Seed = 0,
    backend: Backend = "piqp",
    kill: Kill = None,
    controller: Controller = "mpc",
    as_json: Json = False,
) -> None:
    """Fly the same closed loop in one process on a virtual clock: no network, the same result every time."""
    from mpc_cover.service.kills import parse_kills  # noqa: PLC0415
    from mpc_cover.service.progress import Progress  # noqa: PLC0415
    from mpc_cover.service.run_folder import RunFolder, default_folder, step_times_of  # noqa: PLC0415
    from mpc_cover.service.simulate import simulate as run_simulation  # noqa: PLC0415

    _check_backend(backend)
    loaded = _load(mission)
    deaths = parse_kills(kill or [], loaded)
    potential = cli_swarm.flies_alone(controller, loaded)
    folder = RunFolder(out or default_folder(loaded), "simulate", loaded)
    console = _console(as_json)
    if potential:
        summary, extra, status = cli_swarm.simulate(loaded, folder, console, seed=seed, deaths=deaths)
        _finish(console, summary, extra, as_json, where=folder.path)
        raise typer.Exit(status)
    with Progress(console) as progress:
        result = run_simulation(loaded, backend=backend, seed=seed, deaths=deaths, on_tick=progress.show)
    times = step_times_of([step.tick_time_s for step in result.steps if step.kind == "step"])
    console.print(result.outcome, highlight=False, markup=False, soft_wrap=True)
    ended = {"complete": result.complete, "outcome": result.outcome, "lost": list(result.lost)}
    summary = folder.write(result.trajectory, times, ended)
    extra = {"folder": str(folder.path), **ended}
    _finish(console, summary, extra, as_json, where=folder.path)
    raise typer.Exit(0 if result.complete and summary.holds else 1)


@app.command()
def plan(
    mission: OptionalMission = "box-3",
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
        str, typer.Option("--cones", help="Speeds, inputs, edges as polygons inside their discs, or exact (clarabel).")
    ] = "polygons",
    profile: Annotated[bool, typer.Option("--profile", help="Show where the time goes.")] = False,
    seed: Seed = 0,
    backend: Backend = "piqp",
    as_json: Json = False,
) -> None:
    """Solve the optimal coverage NLP offline, over the mission's planning.duration_s."""
    from mpc_cover.planning.offline import PlanOptions  # noqa: PLC0415
    from mpc_cover.studies.plans import plan_files  # noqa: PLC0415

    _check_backend(backend)
    if time_limit is not None and not (math.isfinite(time_limit) and time_limit > 0.0):
        raise UserError(f"--time-limit {time_limit:g}: must be a number of seconds greater than 0")
    if cones not in {"polygons", "exact"}:
        raise UserError(f"--cones {cones}: must be polygons or exact")
    options = PlanOptions(backend, seed, starts, time_limit, min_time, cones == "exact")
    console, several = _console(as_json), everything is not None
    results = plan_files(everything or mission, out, options, console, folder=several, profile=profile)
    for summary, extra in results:
        _finish(console, summary, extra, as_json and not several, where=Path(extra["file"]))
    if as_json and several:
        _print_json({"plans": [{**summary.to_dict(), **extra} for summary, extra in results]})
    raise typer.Exit(0 if all(summary.holds for summary, _ in results) else 1)


@app.command()
def check(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A trajectory file, or a run folder.")],
    as_json: Json = False,
) -> None:
    """Verify a trajectory independently: what holds, and by what margin; exit status 0 if all does, else 1."""
    from mpc_cover.service.run_folder import find_trajectory  # noqa: PLC0415
    from mpc_cover.trajectory import load_trajectory  # noqa: PLC0415
    from mpc_cover.verification.check import check_trajectory  # noqa: PLC0415
    from mpc_cover.verification.summary import summarise  # noqa: PLC0415
    from mpc_cover.view.tables import print_report  # noqa: PLC0415

    trajectory = load_trajectory(find_trajectory(file))
    report = check_trajectory(trajectory)
    print_report(report, _console(as_json))
    if as_json:
        _print_json({**report.to_dict(), "summary": summarise(trajectory, report).to_dict()})
    raise typer.Exit(0 if report.holds else 1)


@app.command()
def plot(
    path: Annotated[Path, typer.Argument(metavar="FILE|DIR", help="A trajectory file, or a run folder.")],
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for the PNGs; default the run folder, or FILE without .npz.")
    ] = None,
) -> None:
    """Draw a trajectory: paths over the coverage map, coverage, speeds, inputs, distances, step times."""
    from mpc_cover.service.run_folder import find_trajectory, read_step_times  # noqa: PLC0415
    from mpc_cover.trajectory import load_trajectory  # noqa: PLC0415
    from mpc_cover.verification.check import check_trajectory  # noqa: PLC0415
    from mpc_cover.view.figures import draw_run  # noqa: PLC0415

    file = find_trajectory(path)
    trajectory = load_trajectory(file)
    beside = path if path.is_dir() else file.with_suffix("")
    files = draw_run(trajectory, out or beside, read_step_times(file.parent), check_trajectory(trajectory))
    for drawn in files:
        typer.echo(drawn)


def main() -> None:
    """Run the command line; the entry point of `mpc-cover`."""
    try:
        app(prog_name="mpc-cover")
    except UserError as error:
        sys.stderr.write(f"mpc-cover: {error}\n")
        sys.exit(USER_ERROR)


def _load(mission: str) -> Mission:
    from mpc_cover.mission.load import load_mission  # noqa: PLC0415 - --help needs no pydantic

    return load_mission(mission)


def _check_speed(speed: float) -> None:
    if not math.isfinite(speed) or speed <= 0.0:
        raise UserError(f"--speed {speed:g}: must be a number greater than 0")


def _check_backend(name: str) -> None:
    from solvers.backends.registry import BACKENDS  # noqa: PLC0415 - imports no back-end

    if name not in BACKENDS:
        raise UserError(f"--backend {name}: is none: must be one of {', '.join(BACKENDS)}")


def _network(
    connect: list[str] | None,
    listen: list[str] | None,
    config: Path | None,
    timeout: float,
    *,
    default_connect: str | None = None,
    default_listen: str | None = None,
) -> NetworkOptions:
    """Return the options; the defaults hold only when nothing else is said."""
    from mpc_cover.service.network import NetworkOptions  # noqa: PLC0415

    if not math.isfinite(timeout) or timeout < 0.0:
        raise UserError(f"--connect-timeout {timeout:g}: must be a number of seconds, 0 or more")
    if not (connect or listen or config):
        connect = [default_connect] if default_connect else []
        listen = [default_listen] if default_listen else []
    return NetworkOptions(tuple(listen or ()), tuple(connect or ()), config, timeout)


def _console(as_json: bool) -> Console:
    from rich.console import Console  # noqa: PLC0415

    return Console(stderr=as_json)


def _finish(console: Console, summary: Any, extra: dict[str, Any], as_json: bool, *, where: Path) -> None:
    """Print the summary for a person, and as JSON where asked for."""
    from mpc_cover.view.tables import print_summary  # noqa: PLC0415

    if summary is not None:
        print_summary(summary, console)
    console.print(f"written to {where}", highlight=False, markup=False, soft_wrap=True)
    if as_json:
        _print_json({**(summary.to_dict() if summary is not None else {}), **extra})


def _print_json(data: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(data, allow_nan=False) + "\n")
