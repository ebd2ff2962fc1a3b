"""`mpc-cover demo`: a controller and its agents as real processes on this machine."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from mpc_cover.cli.network_options import FleetFolder, warn
from mpc_cover.cli.options import (
    ControllerOption,
    FlightBackend,
    Json,
    Kill,
    OptionalMission,
    Overwrite,
    RunOut,
    Seed,
    Speed,
    check_speed,
    console_for,
    controller_for,
    finish,
    flight_backend,
    load,
)
from mpc_cover.control.controller_name import ControllerName

if TYPE_CHECKING:
    from pathlib import Path

    from rich.console import Console

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.run.demo_processes import DemoOptions
    from mpc_cover.service.run.run_folder import RunFolder
    from mpc_cover.verification.summary import RunSummary


def demo(
    mission: OptionalMission = "box-3",
    out: RunOut = None,
    overwrite: Overwrite = False,
    seed: Seed = 0,
    backend: FlightBackend = None,
    speed: Speed = 1.0,
    kill: Kill = None,
    controller: ControllerOption = ControllerName.MPC.value,
    credentials: FleetFolder = None,
    as_json: Json = False,
) -> None:
    """Fly a mission with a controller and its agents as real processes over Zenoh on loopback."""
    from mpc_cover.service.run.demo_processes import DemoOptions  # noqa: PLC0415 - --help needs none of these
    from mpc_cover.service.run.fault_injection import parse_kills  # noqa: PLC0415
    from mpc_cover.service.run.run_folder import RunFolder, run_path  # noqa: PLC0415
    from mpc_cover.trajectory_file import RecordingKind  # noqa: PLC0415

    check_speed(speed)
    solver = flight_backend(backend, controller)
    loaded = load(mission)
    deaths = parse_kills(kill or [], loaded)
    if credentials is not None:
        _check_fleet(credentials, loaded)
    distributed = controller_for(controller, loaded) is ControllerName.POTENTIAL
    fly = _fly_distributed if distributed else _fly_centralised
    folder = RunFolder(run_path(out, loaded, overwrite=overwrite), RecordingKind.DEMO, loaded)
    console = console_for(as_json=as_json)
    fleet = f"{loaded.fleet.size} agents, {loaded.field.size} cells"
    console.print(f"{loaded.spec.name}: {fleet}; run folder {folder.path}", highlight=False, markup=False)
    summary, extra, status = fly(loaded, DemoOptions(solver, seed, speed, deaths, credentials), folder, console)
    finish(console, summary, extra, as_json=as_json, where=folder.path)
    raise typer.Exit(status)


def _check_fleet(folder: Path, mission: Mission) -> None:
    """Check that there are credentials of everybody who takes part.

    Raises
    ------
    UserError
        Some are missing, or cannot be used.
    """
    from mpc_cover.service.credentials.folder import load_credentials  # noqa: PLC0415 - others need none
    from mpc_cover.service.credentials.roles import CONTROLLER, ROUTER  # noqa: PLC0415 - likewise

    for role in (ROUTER, CONTROLLER, *mission.fleet.ids):
        load_credentials(folder / role, warn).require(role, f"the {role} of a demo")


def _fly_centralised(
    mission: Mission, options: DemoOptions, folder: RunFolder, console: Console
) -> tuple[RunSummary | None, dict[str, Any], int]:
    """Fly with a controller; return the summary, further results, and the exit status."""
    from mpc_cover.service.run.demo import run_demo  # noqa: PLC0415 - as above

    result = run_demo(mission, options, folder, console)
    extra = {
        "folder": str(folder.path),
        "outcome": result.outcome,
        "controller_restarts": result.controller_restarts,
        "lost": list(result.lost),
        "exit_status": result.exit_status,
    }
    return result.summary, extra, result.exit_status


def _fly_distributed(
    mission: Mission, options: DemoOptions, folder: RunFolder, console: Console
) -> tuple[RunSummary | None, dict[str, Any], int]:
    """Fly by the potential law, one process per agent; returns as `_fly_centralised` does."""
    from mpc_cover.service.run.swarm_demo import run_swarm_demo  # noqa: PLC0415 - as above

    result = run_swarm_demo(mission, options, folder, console)
    extra: dict[str, Any] = {"folder": str(folder.path), "outcome": result.outcome, "exit_status": result.exit_status}
    extra |= {"controller": ControllerName.POTENTIAL, "lost": list(result.lost)}
    return result.summary, extra, result.exit_status
