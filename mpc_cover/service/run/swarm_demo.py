"""The demo without a controller: one process per agent over Zenoh on this machine, supervised until they end."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.clock import MonotonicClock
from mpc_cover.control.controller_name import ControllerName
from mpc_cover.distributed.setup import check_flyable
from mpc_cover.service.run.daemon import Signals
from mpc_cover.service.run.demo import open_observer, write_records
from mpc_cover.service.run.demo_outcome import INTERRUPTED_OUTCOME, DemoResult, Ending, Outcome, exit_status
from mpc_cover.service.run.demo_processes import CONNECT_TIMEOUT_S, DemoOptions
from mpc_cover.service.run.demo_watch import COMPLETE, DEAD_AGENT_TIMEOUT_S, POLL_S, complete, kill_due
from mpc_cover.service.run.processes import Child, free_port, terminate_all
from mpc_cover.service.run.progress import Progress
from mpc_cover.service.run.swarm_observer import SwarmObserver
from mpc_cover.trajectory_file import RecordingKind
from mpc_cover.version import __version__

if TYPE_CHECKING:
    from rich.console import Console

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.run.run_folder import RunFolder
    from mpc_cover.verification.summary import RunSummary


def run_swarm_demo(mission: Mission, options: DemoOptions, folder: RunFolder, console: Console) -> DemoResult:
    """Fly a mission with real processes and no controller; in any case they end and the run folder is written.

    Raises
    ------
    UserError
        The law cannot fly this mission, or something cannot be used as asked.
    """
    check_flyable(mission)
    with Signals() as signals:
        endpoint, transport = open_observer(MonotonicClock(options.speed), signals, options)
        try:
            observer = SwarmObserver(mission, transport, MonotonicClock(options.speed))
            processes = _AgentProcesses(mission, options, folder, endpoint)
            try:
                with Progress() as progress:
                    outcome = processes.until_over(observer, signals, progress)
            finally:
                processes.end()
        finally:
            transport.close()
        console.print(f"{outcome.text}; writes the run folder", highlight=False, markup=False, soft_wrap=True)
        summary = _write(mission, options, folder, outcome.text, processes.died)
    status = exit_status(outcome, summary, signals.received)
    return DemoResult(status, outcome.text, summary, 0, tuple(processes.died))


class _AgentProcesses:
    """The agents' processes; each listens, and connects to those before it and to the observer."""

    def __init__(self, mission: Mission, options: DemoOptions, folder: RunFolder, observer: str) -> None:
        self.agents: list[Child] = []
        self.died: list[str] = []
        self._mission, self._options, self._folder, self._observer = mission, options, folder, observer
        self._deaths = dict(options.deaths)
        self._waits_since: float | None = None

    def until_over(self, observer: SwarmObserver, signals: Signals, progress: Progress) -> Outcome:
        """Start all, and return the outcome once they are over."""
        if signals.stop.is_set():
            return INTERRUPTED_OUTCOME
        self._start()
        names = ", ".join(f"{child.name} {child.pid}" for child in self.agents)
        progress.say(f"processes: {names}; Ctrl-C ends them")
        while not signals.stop.wait(POLL_S):
            for event in observer.look():
                progress.say(event)
            if observer.status is not None:
                progress.show(observer.status)
                kill_due(self.agents, self._deaths, observer.status.mission_time_s)
            if (outcome := self._outcome(observer, progress)) is not None:
                return outcome
        return INTERRUPTED_OUTCOME

    def end(self) -> None:
        """End all."""
        terminate_all(self.agents)

    def _start(self) -> None:
        ports = [int(self._observer.rsplit(":", 1)[1])]
        endpoints: list[str] = []
        common = ["--controller", ControllerName.POTENTIAL.value, "--speed", repr(self._options.speed)]
        common += ["--seed", str(self._options.seed)]
        for name in self._mission.fleet.ids:
            arguments = ["agent", str(self._folder.mission_file), "--id", name, *common, *self._options.of_role(name)]
            arguments += ["--connect-timeout", f"{CONNECT_TIMEOUT_S:g}", "--connect", self._observer]
            if self._options.credentials is None:  # with them the observer passes on what each may say
                for other in endpoints:
                    arguments += ["--connect", other]
                ports.append(free_port(ports))
                endpoints.append(f"tcp/127.0.0.1:{ports[-1]}")
                arguments += ["--listen", endpoints[-1]]
            arguments += ["--record", str(self._folder.record(name))]
            self.agents.append(Child(name, arguments, self._folder.log(name)))

    def _outcome(self, observer: SwarmObserver, progress: Progress) -> Outcome | None:
        """Return the outcome, or None while an agent flies."""
        for agent in self.agents:
            if agent.exit_status not in {None, 0, 1} and agent.name not in self.died:
                self.died.append(agent.name)
                progress.say(f"{agent.name} died (exit status {agent.exit_status}):\n{agent.last_lines()}")
        remaining = [agent for agent in self.agents if agent.name not in self.died]
        if not remaining or (observer.status is None and self._wait_in_vain()):
            return Outcome(Ending.FAILED, f"{', '.join(self.died)} died")
        if any(agent.exit_status is None for agent in remaining):
            return None
        if gave_up := [agent for agent in remaining if agent.exit_status == 1]:
            return Outcome(Ending.FAILED, f"{gave_up[0].name} gave up: {gave_up[0].last_lines(1)}")
        return complete(COMPLETE, self.died)

    def _wait_in_vain(self) -> bool:
        """Return whether the others have waited long enough for an agent that died before the start."""
        if not self.died:
            return False
        now = time.monotonic()
        self._waits_since = now if self._waits_since is None else self._waits_since
        return now - self._waits_since > DEAD_AGENT_TIMEOUT_S


def _write(
    mission: Mission, options: DemoOptions, folder: RunFolder, outcome: str, died: list[str]
) -> RunSummary | None:
    """Merge the agents' records and write the run folder; None when nothing was flown."""
    controller = {"controller": ControllerName.POTENTIAL}
    extra: dict[str, Any] = {"outcome": outcome, "lost": died, "folder": str(folder.path), **controller}
    meta = {
        "kind": RecordingKind.DEMO,
        "version": __version__,
        "seed": options.seed,
        "speed": options.speed,
        **controller,
    }
    return write_records(mission, folder, meta, extra, died, np.empty(0))
