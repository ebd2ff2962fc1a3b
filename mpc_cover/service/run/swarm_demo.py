"""A fleet without a controller: one process an agent over Zenoh on loopback, watched until they end by themselves."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.clock import MonotonicClock
from mpc_cover.distributed.setup import check_flyable
from mpc_cover.service.run.daemon import INTERRUPTED, Signals
from mpc_cover.service.run.demo import open_observer, write_records
from mpc_cover.service.run.demo_options import DemoOptions, DemoResult
from mpc_cover.service.run.demo_processes import CONNECT_TIMEOUT_S
from mpc_cover.service.run.demo_watch import COMPLETE, LOOK_S, MOURNING_S, kill_due
from mpc_cover.service.run.processes import Child, end_all, free_port
from mpc_cover.service.run.progress import Progress
from mpc_cover.service.run.swarm_observer import SwarmObserver
from mpc_cover.version import __version__

if TYPE_CHECKING:
    from rich.console import Console

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.run.run_folder import RunFolder
    from mpc_cover.verification.summary import RunSummary


def run_swarm_demo(mission: Mission, options: DemoOptions, folder: RunFolder, console: Console) -> DemoResult:
    """Fly a mission with real processes and no controller; whatever happens, they end and the run folder is written.

    Raises
    ------
    UserError
        The law cannot fly this mission, or something cannot be used as asked.
    """
    check_flyable(mission)
    with Signals() as signals:
        endpoint, transport = open_observer(MonotonicClock(options.speed), signals)
        try:
            observer = SwarmObserver(mission, transport, MonotonicClock(options.speed))
            fleet = _Fleet(mission, options, folder, endpoint)
            try:
                with Progress(console) as progress:
                    outcome = fleet.watch(observer, signals, progress)
            finally:
                fleet.end()
        finally:
            transport.close()
        console.print(f"{outcome}; writes the run folder", highlight=False, markup=False, soft_wrap=True)
        summary = _write(mission, options, folder, outcome, fleet.died)
    complete = outcome.startswith(COMPLETE) and summary is not None and summary.holds
    complete = complete and summary is not None and summary.covered_cells == summary.cells
    status = INTERRUPTED if signals.received else 0 if complete else 1
    return DemoResult(status, outcome, summary, 0, tuple(fleet.died))


class _Fleet:
    """The agents' processes; each listens, and connects to those before it and to whoever watches."""

    def __init__(self, mission: Mission, options: DemoOptions, folder: RunFolder, observer: str) -> None:
        self.agents: list[Child] = []
        self.died: list[str] = []
        self._mission, self._options, self._folder, self._observer = mission, options, folder, observer
        self._deaths = dict(options.deaths)
        self._mourned_s: float | None = None

    def watch(self, observer: SwarmObserver, signals: Signals, progress: Progress) -> str:
        """Start all, and return how it ended, in words."""
        if signals.stop.is_set():
            return "interrupted"
        self._start()
        names = ", ".join(f"{child.name} {child.pid}" for child in self.agents)
        progress.say(f"processes: {names}; Ctrl-C ends them")
        while not signals.stop.wait(LOOK_S):
            for event in observer.look():
                progress.say(event)
            if observer.status is not None:
                progress.show(observer.status)
                kill_due(self.agents, self._deaths, observer.status.mission_time_s)
            if (outcome := self._outcome(observer, progress)) is not None:
                return outcome
        return "interrupted"

    def end(self) -> None:
        """End all."""
        end_all(self.agents)

    def _start(self) -> None:
        ports = [int(self._observer.rsplit(":", 1)[1])]
        endpoints: list[str] = []
        common = ["--controller", "potential", "--speed", repr(self._options.speed), "--seed", str(self._options.seed)]
        for name in self._mission.fleet.ids:
            ports.append(free_port(ports))
            endpoints.append(f"tcp/127.0.0.1:{ports[-1]}")
            arguments = ["agent", str(self._folder.mission_file), "--id", name, *common]
            arguments += ["--connect-timeout", f"{CONNECT_TIMEOUT_S:g}", "--listen", endpoints[-1]]
            for other in (self._observer, *endpoints[:-1]):
                arguments += ["--connect", other]
            arguments += ["--record", str(self._folder.record(name))]
            self.agents.append(Child(name, arguments, self._folder.log(name)))

    def _outcome(self, observer: SwarmObserver, progress: Progress) -> str | None:
        """Return how it ended, or None while someone flies."""
        for agent in self.agents:
            if agent.exit_status not in {None, 0, 1} and agent.name not in self.died:
                self.died.append(agent.name)
                progress.say(f"{agent.name} died (exit status {agent.exit_status}):\n{agent.last_lines()}")
        living = [agent for agent in self.agents if agent.name not in self.died]
        if not living or (observer.status is None and self._in_vain()):
            return f"{', '.join(self.died)} died"
        if any(agent.exit_status is None for agent in living):
            return None
        if gave_up := [agent for agent in living if agent.exit_status == 1]:
            return f"{gave_up[0].name} gave up: {gave_up[0].last_lines(1)}"
        return f"{COMPLETE} without {', '.join(self.died)}" if self.died else COMPLETE

    def _in_vain(self) -> bool:
        """Return whether the others have waited long enough for someone who died before the start."""
        if not self.died:
            return False
        now = time.monotonic()
        self._mourned_s = now if self._mourned_s is None else self._mourned_s
        return now - self._mourned_s > MOURNING_S


def _write(
    mission: Mission, options: DemoOptions, folder: RunFolder, outcome: str, died: list[str]
) -> RunSummary | None:
    """Merge the agents' records and write the run folder; None when nothing was flown."""
    extra: dict[str, Any] = {"outcome": outcome, "lost": died, "folder": str(folder.path), "controller": "potential"}
    meta = {
        "kind": "demo",
        "version": __version__,
        "seed": options.seed,
        "speed": options.speed,
        "controller": "potential",
    }
    return write_records(mission, folder, meta, extra, died, np.empty(0))
