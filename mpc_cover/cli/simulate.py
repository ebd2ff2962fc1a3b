"""`mpc-cover simulate`: the closed loop in one process on a virtual clock."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from mpc_cover.cli.options import (
    ControllerOption,
    FlightBackend,
    Json,
    Kill,
    MissionArgument,
    Overwrite,
    RunOut,
    Seed,
    console_for,
    controller_for,
    finish,
    flight_backend,
    load,
)
from mpc_cover.control.controller_name import ControllerName
from mpc_cover.exit_status import exit_status

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rich.console import Console

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.run.run_folder import RunFolder
    from mpc_cover.service.run.simulate import Simulation
    from mpc_cover.service.run.swarm_simulate import SwarmFlight
    from mpc_cover.verification.summary import RunSummary


def simulate(
    mission: MissionArgument,
    out: RunOut = None,
    overwrite: Overwrite = False,
    seed: Seed = 0,
    backend: FlightBackend = None,
    kill: Kill = None,
    controller: ControllerOption = ControllerName.MPC.value,
    as_json: Json = False,
) -> None:
    """Fly the same closed loop in one process on a virtual clock: no network, the same result every time.

    Ctrl-C ends the flight: what was flown until then is written, and the exit status is 130.
    """
    from mpc_cover.service.run.fault_injection import parse_kills  # noqa: PLC0415 - --help needs none of these
    from mpc_cover.service.run.run_folder import RunFolder, run_path  # noqa: PLC0415
    from mpc_cover.trajectory_file import RecordingKind  # noqa: PLC0415

    solver = flight_backend(backend, controller)
    loaded = load(mission)
    deaths = parse_kills(kill or [], loaded)
    distributed = controller_for(controller, loaded) is ControllerName.POTENTIAL
    folder = RunFolder(run_path(out, loaded, overwrite=overwrite), RecordingKind.SIMULATE, loaded)
    console = console_for(as_json=as_json)
    if distributed:
        summary, extra, status = _fly_distributed(loaded, seed, deaths, folder, console)
    else:
        summary, extra, status = _fly_centralised(loaded, solver, seed, deaths, folder, console)
    finish(console, summary, extra, as_json=as_json, where=folder.path)
    raise typer.Exit(status)


def _fly_centralised(
    mission: Mission, backend: str, seed: int, deaths: Mapping[str, float], folder: RunFolder, console: Console
) -> tuple[RunSummary, dict[str, Any], int]:
    """Fly with a controller; return the summary, further results, and the exit status."""
    from mpc_cover.service.controller.step_log import StepKind  # noqa: PLC0415 - as above
    from mpc_cover.service.run.progress import Progress  # noqa: PLC0415
    from mpc_cover.service.run.run_folder import step_times_of  # noqa: PLC0415
    from mpc_cover.service.run.simulate import simulate as run_simulation  # noqa: PLC0415

    with Progress() as progress:
        result = run_simulation(
            mission, backend=backend, seed=seed, deaths=deaths, on_tick=progress.show, keep_on_interrupt=True
        )
    times = step_times_of([step.tick_time_s for step in result.steps if step.kind is StepKind.STEP])
    console.print(result.outcome, highlight=False, markup=False, soft_wrap=True)
    ended = {"complete": result.complete, "outcome": result.outcome, "lost": list(result.lost)}
    summary = folder.write(result.trajectory, times, ended)
    return summary, {"folder": str(folder.path), **ended}, _status(summary, result)


def _status(summary: RunSummary, flight: Simulation | SwarmFlight) -> int:
    """Return the exit status of a flight."""
    return exit_status(holds=summary.holds, covered=flight.complete, interrupted=flight.interrupted)


def _fly_distributed(
    mission: Mission, seed: int, deaths: Mapping[str, float], folder: RunFolder, console: Console
) -> tuple[RunSummary, dict[str, Any], int]:
    """Fly by the potential law, each agent by itself; returns as `_fly_centralised` does."""
    import numpy as np  # noqa: PLC0415 - as above

    from mpc_cover.service.run.progress import Progress  # noqa: PLC0415
    from mpc_cover.service.run.swarm_simulate import fly_swarm  # noqa: PLC0415

    with Progress() as progress:
        flight = fly_swarm(mission, seed=seed, deaths=deaths, on_tick=progress.show, keep_on_interrupt=True)
    console.print(flight.outcome, highlight=False, markup=False, soft_wrap=True)
    times = np.array([time_s for each in flight.decision_times_s.values() for time_s in each])
    extra: dict[str, Any] = {
        "complete": flight.complete,
        "outcome": flight.outcome,
        "controller": ControllerName.POTENTIAL,
        "lost": list(flight.lost),
        "messages": flight.messages,
        "bytes": flight.bytes,
    }
    if flight.estimate_errors:
        extra["estimate_rms_errors"] = flight.estimate_errors
    summary = folder.write(flight.trajectory, times, extra)
    extra["folder"] = str(folder.path)
    return summary, extra, _status(summary, flight)
