"""The demo: a controller and its agents as processes over Zenoh on this machine, supervised until the end."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mpc_cover.clock import MonotonicClock
from mpc_cover.errors import UserError
from mpc_cover.record_seal import sealed
from mpc_cover.service.agent.recorder import read_record
from mpc_cover.service.controller.step_log import StepKind, read_steps
from mpc_cover.service.credentials.folder import load_credentials
from mpc_cover.service.credentials.roles import ROUTER
from mpc_cover.service.protocol.network import NetworkOptions
from mpc_cover.service.protocol.secure_network import TLS
from mpc_cover.service.protocol.transport import open_transport
from mpc_cover.service.run.daemon import Signals
from mpc_cover.service.run.demo_outcome import DemoResult, exit_status
from mpc_cover.service.run.demo_processes import DemoOptions, Processes
from mpc_cover.service.run.demo_watch import Watch, completion_text
from mpc_cover.service.run.observer import Observer
from mpc_cover.service.run.processes import free_port
from mpc_cover.service.run.progress import Progress
from mpc_cover.service.run.recording import merge
from mpc_cover.service.run.run_folder import step_times_of
from mpc_cover.service.run.sources import SOURCES, source_digests
from mpc_cover.trajectory_file import RecordingKind
from mpc_cover.version import __version__

if TYPE_CHECKING:
    from rich.console import Console

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.protocol.bus import Transport
    from mpc_cover.service.run.run_folder import RunFolder
    from mpc_cover.verification.summary import RunSummary

PORT_ATTEMPTS = 5


def run_demo(mission: Mission, options: DemoOptions, folder: RunFolder, console: Console) -> DemoResult:
    """Fly a mission with real processes; in any case they end and the run folder is written.

    Raises
    ------
    UserError
        Something cannot be used as asked.
    """
    with Signals() as signals:
        clock = MonotonicClock()
        endpoint, transport = open_observer(clock, signals, options)
        try:
            processes = Processes(mission, options, folder, endpoint)
            observer = Observer(mission, transport, clock)
            try:
                with Progress() as progress:
                    over = completion_text(mission)
                    watch = Watch(processes, observer, signals, progress, options.deaths, over=over)
                    outcome = watch.until_over()
            finally:
                died = [agent.name for agent in processes.dead_agents()]
                processes.end()
        finally:
            transport.close()
        console.print(f"{outcome.text}; writes the run folder", highlight=False, markup=False, soft_wrap=True)
        summary = _write(mission, options, folder, outcome.text, processes.restarts, died)
    status = exit_status(outcome, summary, signals.received)
    return DemoResult(status, outcome.text, summary, processes.restarts, tuple(died))


def open_observer(clock: MonotonicClock, signals: Signals, options: DemoOptions) -> tuple[str, Transport]:
    """Listen on a free port, and on another one if it is taken meanwhile; return the endpoint and the transport."""
    folder = options.credentials
    credentials = load_credentials(folder / ROUTER, _told_already) if folder is not None else None
    protocol = "tcp" if credentials is None else TLS
    for attempt in range(PORT_ATTEMPTS):
        endpoint = f"{protocol}/127.0.0.1:{free_port()}"
        try:
            network = NetworkOptions(listen=(endpoint,), credentials=credentials)
            return endpoint, open_transport(network, clock, signals.stop)
        except UserError:
            if attempt == PORT_ATTEMPTS - 1:
                raise
    raise AssertionError  # unreachable: the last attempt returns or raises


def _told_already(warning: str) -> None:
    """Pass over a warning that the command has given."""


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
    times = [step.tick_time_s for step in steps if step.kind is StepKind.STEP]
    meta = {
        "kind": RecordingKind.DEMO,
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
    """Merge the agents' records, seal the recording, and write the run folder.

    Returns None, with the problem in summary.json, where records lack. `meta` is written into the trajectory, `extra`
    into the summary; `step_times` is (S,) [s].
    """
    try:
        records = [read_record(folder.record(name))[1] for name in mission.fleet.ids]
        trajectory = merge(mission, records, {**meta, SOURCES: source_digests(folder.path)}, died)
    except UserError as error:
        folder.write_summary({**extra, "problem": str(error)})
        return None
    return folder.write(sealed(trajectory), step_times, extra)
