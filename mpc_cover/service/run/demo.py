"""The whole line at once: a controller and its agents as processes over Zenoh, watched until the end."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mpc_cover.clock import MonotonicClock
from mpc_cover.errors import UserError
from mpc_cover.service.agent.recorder import read_record
from mpc_cover.service.controller.step_log import read_steps
from mpc_cover.service.protocol.network import NetworkOptions
from mpc_cover.service.protocol.transport import open_transport
from mpc_cover.service.run.daemon import INTERRUPTED, Signals
from mpc_cover.service.run.demo_options import DemoOptions, DemoResult
from mpc_cover.service.run.demo_processes import Processes
from mpc_cover.service.run.demo_watch import Watch, ended_well
from mpc_cover.service.run.observer import Observer
from mpc_cover.service.run.processes import free_port
from mpc_cover.service.run.progress import Progress
from mpc_cover.service.run.recording import merge
from mpc_cover.service.run.run_folder import step_times_of
from mpc_cover.version import __version__

if TYPE_CHECKING:
    from rich.console import Console

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.protocol.transport import ZenohTransport
    from mpc_cover.service.run.run_folder import RunFolder
    from mpc_cover.verification.summary import RunSummary

PORT_ATTEMPTS = 5


def run_demo(mission: Mission, options: DemoOptions, folder: RunFolder, console: Console) -> DemoResult:
    """Fly a mission with real processes; whatever happens, they end and the run folder is written.

    Raises
    ------
    UserError
        Something cannot be used as asked.
    """
    with Signals() as signals:
        clock = MonotonicClock()
        endpoint, transport = open_observer(clock, signals)
        try:
            fleet = Processes(mission, options, folder, endpoint)
            observer = Observer(mission, transport, clock)
            try:
                with Progress(console) as progress:
                    watch = Watch(fleet, observer, signals, progress, options.deaths, over=ended_well(mission))
                    outcome = watch.until_over()
            finally:
                died = [agent.name for agent in fleet.dead_agents()]
                fleet.end()
        finally:
            transport.close()
        console.print(f"{outcome}; writes the run folder", highlight=False, markup=False, soft_wrap=True)
        summary = _write(mission, options, folder, outcome, fleet.restarts, died)
    complete = (
        outcome.startswith(ended_well(mission))
        and summary is not None
        and summary.holds
        and summary.covered_cells == summary.cells
    )
    status = INTERRUPTED if signals.received else 0 if complete else 1
    return DemoResult(status, outcome, summary, fleet.restarts, tuple(died))


def open_observer(clock: MonotonicClock, signals: Signals) -> tuple[str, ZenohTransport]:
    """Listen on a free port; another one when someone was faster."""
    for attempt in range(PORT_ATTEMPTS):
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        try:
            return endpoint, open_transport(NetworkOptions(listen=(endpoint,)), clock, signals.stop)
        except UserError:
            if attempt == PORT_ATTEMPTS - 1:
                raise
    raise AssertionError  # unreachable: the last attempt returns or raises


def _write(
    mission: Mission, options: DemoOptions, folder: RunFolder, outcome: str, restarts: int, died: list[str]
) -> RunSummary | None:
    """Merge the agents' records and write the run folder; None when nothing was flown."""
    extra: dict[str, Any] = {
        "outcome": outcome,
        "controller_restarts": restarts,
        "lost": died,
        "folder": str(folder.path),
    }
    steps = read_steps(folder.step_log)
    times = [step.tick_time_s for step in steps if step.kind == "step"]
    meta = {
        "kind": "demo",
        "version": __version__,
        "seed": options.seed,
        "backend": options.backend,
        "speed": options.speed,
    }
    return write_records(mission, folder, meta, extra, died, step_times_of(times))


def write_records(
    mission: Mission,
    folder: RunFolder,
    meta: dict[str, Any],
    extra: dict[str, Any],
    died: list[str],
    step_times: FloatArray,
) -> RunSummary | None:
    """Merge the agents' records and write the run folder; None, with the problem in summary.json, where they lack.

    `meta` goes into the trajectory, `extra` into the summary; `step_times` is (S,) [s].
    """
    try:
        records = [read_record(folder.record(name))[1] for name in mission.fleet.ids]
        trajectory = merge(mission, records, meta, died)
    except UserError as error:
        folder.write_summary({**extra, "problem": str(error)})
        return None
    return folder.write(trajectory, step_times, extra)
