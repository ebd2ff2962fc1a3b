"""The whole line at once: a controller and its agents as processes over Zenoh, watched until the end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mpc_cover import __version__
from mpc_cover.clock import MonotonicClock
from mpc_cover.errors import UserError
from mpc_cover.service.daemon import INTERRUPTED, Signals
from mpc_cover.service.network import NetworkOptions
from mpc_cover.service.observer import Observer
from mpc_cover.service.processes import Child, end_all, free_port
from mpc_cover.service.progress import Progress
from mpc_cover.service.recorder import read_record
from mpc_cover.service.recording import merge
from mpc_cover.service.run_folder import step_times_of
from mpc_cover.service.step_log import read_steps
from mpc_cover.service.transport import open_transport

if TYPE_CHECKING:
    from rich.console import Console

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.run_folder import RunFolder
    from mpc_cover.service.transport import ZenohTransport
    from mpc_cover.verification.summary import RunSummary

LOOK_S = 0.1
"""How often the demo looks [s]."""
MAX_RESTARTS = 3
PATIENCE_S = 1.0
"""An agent is at rest when it said so within this time [s]."""
CONNECT_TIMEOUT_S = 30.0
"""Several processes start at once, perhaps on a slow machine [s]."""
PORT_ATTEMPTS = 5
COMPLETE = "everything is covered"


@dataclass(frozen=True)
class DemoOptions:
    """How to fly: see `mpc-cover demo --help`."""

    backend: str = "piqp"
    seed: int = 0
    speed: float = 1.0


@dataclass(frozen=True, eq=False)
class DemoResult:
    """How a demo ended: the exit status, in words, and the summary unless nothing was flown."""

    exit_status: int
    outcome: str
    summary: RunSummary | None
    controller_restarts: int


def run_demo(mission: Mission, options: DemoOptions, folder: RunFolder, console: Console) -> DemoResult:
    """Fly a mission with real processes; whatever happens, they end and the run folder is written.

    Raises
    ------
    UserError
        Something cannot be used as asked.
    """
    with Signals() as signals:
        clock = MonotonicClock()
        endpoint, transport = _open(clock, signals)
        try:
            fleet = _Processes(mission, options, folder, endpoint)
            observer = Observer(mission, transport, clock)
            try:
                with Progress(console) as progress:
                    outcome = _Watch(fleet, observer, signals, progress).until_over()
            finally:
                fleet.end()
        finally:
            transport.close()
        console.print(f"{outcome}; writes the run folder", highlight=False, markup=False, soft_wrap=True)
        summary = _write(mission, options, folder, outcome, fleet.restarts)
    complete = outcome == COMPLETE and summary is not None and summary.holds and summary.covered_cells == summary.cells
    status = INTERRUPTED if signals.received else 0 if complete else 1
    return DemoResult(status, outcome, summary, fleet.restarts)


def _open(clock: MonotonicClock, signals: Signals) -> tuple[str, ZenohTransport]:
    """Listen on a free port; another one when someone was faster."""
    for attempt in range(PORT_ATTEMPTS):
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        try:
            return endpoint, open_transport(NetworkOptions(listen=(endpoint,)), clock, signals.stop)
        except UserError:
            if attempt == PORT_ATTEMPTS - 1:
                raise
    raise AssertionError  # unreachable: the last attempt returns or raises


class _Processes:
    """The controller and the agents."""

    def __init__(self, mission: Mission, options: DemoOptions, folder: RunFolder, endpoint: str) -> None:
        self._options, self._folder, self._observer = options, folder, endpoint
        self._controller_at = f"tcp/127.0.0.1:{free_port([int(endpoint.rsplit(':', 1)[1])])}"
        self._ids = mission.fleet.ids
        self.restarts = 0
        self.controller: Child | None = None
        self.agents: list[Child] = []

    def start(self) -> None:
        """Start all."""
        self.start_controller()
        for name in self._ids:
            arguments = ["agent", str(self._folder.mission_file), "--id", name, *self._common()]
            arguments += ["--connect", self._controller_at, "--record", str(self._folder.record(name))]
            self.agents.append(Child(name, arguments, self._folder.log(name)))

    def start_controller(self) -> None:
        """Start the controller, also once more: it goes on from its checkpoint."""
        options = self._options
        arguments = ["serve", str(self._folder.mission_file), *self._common(), "--listen", self._controller_at]
        arguments += ["--backend", options.backend, "--seed", str(options.seed)]
        arguments += ["--state-dir", str(self._folder.path / "state"), "--step-log", str(self._folder.step_log)]
        self.controller = Child("controller", arguments, self._folder.log("controller"))

    def dead_agents(self) -> list[Child]:
        """Return the agents that ended by themselves."""
        return [agent for agent in self.agents if agent.exit_status is not None]

    def end(self) -> None:
        """End all, the controller with the agents."""
        end_all([*([self.controller] if self.controller else []), *self.agents])

    def _common(self) -> list[str]:
        timeout = ["--connect-timeout", f"{CONNECT_TIMEOUT_S:g}"]
        return ["--connect", self._observer, "--speed", repr(self._options.speed), *timeout]


class _Watch:
    """Looks until the mission is over, one way or another."""

    def __init__(self, processes: _Processes, observer: Observer, signals: Signals, progress: Progress) -> None:
        self._processes, self._observer = processes, observer
        self._signals, self._progress = signals, progress
        self._bereaved = False

    def until_over(self) -> str:
        """Return how it ended, in words."""
        if self._signals.stop.is_set():
            return "interrupted"
        self._processes.start()
        names = ", ".join(f"{child.name} {child.pid}" for child in self._children())
        self._progress.say(f"processes: {names}; Ctrl-C ends them")
        while not self._signals.stop.wait(LOOK_S):
            for event in self._observer.look():
                self._progress.say(event)
            if self._observer.status is not None:
                self._progress.show(self._observer.status)
            if (outcome := self._outcome()) is not None:
                return outcome
        return "interrupted"

    def _children(self) -> list[Child]:
        controller = self._processes.controller
        return [*([controller] if controller else []), *self._processes.agents]

    def _outcome(self) -> str | None:
        if dead := self._processes.dead_agents():
            for agent in dead:
                self._progress.say(f"{agent.name} died (exit status {agent.exit_status}):\n{agent.last_lines()}")
            return f"{', '.join(agent.name for agent in dead)} died"
        controller = self._processes.controller
        assert controller is not None
        match controller.exit_status:
            case None:
                return None
            case 0:
                return COMPLETE
            case 1:
                return "the controller gave up: " + (controller.last_lines(1) or "see its log")
            case 2:
                return "the controller could not start: " + controller.last_lines()
            case status:
                return self._after_death(controller, status)

    def _after_death(self, controller: Child, status: int) -> str | None:
        """Let the agents finish their plans, then start the controller again."""
        if not self._bereaved:
            self._bereaved = True
            self._progress.say(f"the controller died (exit status {status}): the agents finish their plans")
        if self._processes.restarts >= MAX_RESTARTS:
            return f"the controller died {MAX_RESTARTS + 1} times:\n{controller.last_lines()}"
        if self._observer.at_rest(PATIENCE_S):
            self._bereaved = False
            self._processes.restarts += 1
            self._processes.start_controller()
            pid = self._processes.controller.pid if self._processes.controller else 0
            self._progress.say(f"all agents are at rest: the controller is started again ({pid})")
        return None


def _write(mission: Mission, options: DemoOptions, folder: RunFolder, outcome: str, restarts: int) -> RunSummary | None:
    """Merge the agents' records and write the run folder; None when nothing was flown."""
    extra: dict[str, Any] = {"outcome": outcome, "controller_restarts": restarts, "folder": str(folder.path)}
    steps = read_steps(folder.step_log)
    times = [step.tick_time_s for step in steps if step.kind == "step"]
    meta = {
        "kind": "demo",
        "version": __version__,
        "seed": options.seed,
        "backend": options.backend,
        "speed": options.speed,
    }
    try:
        records = [read_record(folder.record(name))[1] for name in mission.fleet.ids]
        trajectory = merge(mission, records, meta)
    except UserError as error:
        folder.write_summary({**extra, "problem": str(error)})
        return None
    return folder.write(trajectory, step_times_of(times), extra)
