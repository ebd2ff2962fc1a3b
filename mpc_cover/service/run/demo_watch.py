"""Supervises the processes of a demo until it is over: agents may die, and the controller is restarted."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

from mpc_cover.mission.information import AgeingInformation
from mpc_cover.service.protocol.messages import Phase
from mpc_cover.service.run.demo_outcome import INTERRUPTED_OUTCOME, Ending, Outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.run.daemon import Signals
    from mpc_cover.service.run.demo_processes import Processes
    from mpc_cover.service.run.observer import Observer
    from mpc_cover.service.run.processes import Child
    from mpc_cover.service.run.progress import Progress

POLL_S = 0.1
"""Polling period of the demo [s]."""
MAX_RESTARTS = 3
PATIENCE_S = 1.0
"""An agent is at rest if it reported so within this time [s]."""
DEAD_AGENT_TIMEOUT_S = 3.0
"""A controller that still waits for a dead agent after this time will not go on without it [s]."""
COMPLETE = "everything is covered"
PATROLLED = "the patrol is over"


def completion_text(mission: Mission) -> str:
    """Return the text of a complete mission: a patrol never has everything covered for good."""
    return PATROLLED if isinstance(mission.spec.information, AgeingInformation) else COMPLETE


def complete(text: str, dead: Sequence[str]) -> Outcome:
    """Return the outcome of a mission that was completed without the dead agents, given by id."""
    return Outcome(Ending.COMPLETE, f"{text} without {', '.join(dead)}" if dead else text)


def kill_due(agents: Sequence[Child], deaths: dict[str, float], mission_time_s: float) -> None:
    """Kill the agents whose times [s] have come, and remove them from `deaths`."""
    for agent in agents:
        if mission_time_s >= deaths.get(agent.name, math.inf):
            del deaths[agent.name]
            agent.kill()


class Watch:
    """Supervises the processes until the mission is over.

    `deaths` are the mission times [s] at which agents are killed, by id; `monotonic` is the machine's clock,
    `over` the text of a complete mission.
    """

    def __init__(
        self,
        processes: Processes,
        observer: Observer,
        signals: Signals,
        progress: Progress,
        deaths: Mapping[str, float] | None = None,
        monotonic: Callable[[], float] = time.monotonic,
        over: str = COMPLETE,
    ) -> None:
        self._over = over
        self._deaths = dict(deaths or {})
        self._processes, self._observer = processes, observer
        self._signals, self._progress, self._monotonic = signals, progress, monotonic
        self._controller_down = False
        self._dead: list[str] = []
        self._waits_since: float | None = None

    def until_over(self) -> Outcome:
        """Start the processes, and return the outcome once they are over."""
        if self._signals.stop.is_set():
            return INTERRUPTED_OUTCOME
        self._processes.start()
        names = ", ".join(f"{child.name} {child.pid}" for child in self._children())
        self._progress.say(f"processes: {names}; Ctrl-C ends them")
        while not self._signals.stop.wait(POLL_S):
            for event in self._observer.look():
                self._progress.say(event)
            if self._observer.status is not None:
                self._progress.show(self._observer.status)
                kill_due(self._processes.agents, self._deaths, self._observer.status.mission_time_s)
            if (outcome := self._outcome()) is not None:
                return outcome
        return INTERRUPTED_OUTCOME

    def _children(self) -> list[Child]:
        controller = self._processes.controller
        return [*([controller] if controller else []), *self._processes.agents]

    def _outcome(self) -> Outcome | None:
        if (outcome := self._after_deaths(self._processes.dead_agents())) is not None:
            return outcome
        controller = self._processes.controller
        assert controller is not None
        match controller.exit_status:
            case None:
                return None
            case 0:
                return complete(self._over, self._dead)
            case 1:
                return _failed("the controller gave up: " + (controller.last_lines(1) or "see its log"))
            case 2:
                return _failed("the controller could not start: " + controller.last_lines())
            case status:
                return self._after_controller(controller, status)

    def _after_deaths(self, dead: list[Child]) -> Outcome | None:
        """Report which agents died; the others go on, unless none is left or the controller waits for all."""
        for agent in dead:
            if agent.name not in self._dead:
                self._dead.append(agent.name)
                self._progress.say(f"{agent.name} died (exit status {agent.exit_status}):\n{agent.last_lines()}")
        if len(dead) == len(self._processes.agents) or self._waits_in_vain(dead):
            return _failed(f"{', '.join(agent.name for agent in dead)} died")
        return None

    def _waits_in_vain(self, dead: list[Child]) -> bool:
        """Return whether the controller keeps waiting for a dead agent, as it does before the start."""
        status = self._observer.status
        awaited = status is None or {agent.name for agent in dead} - set(status.lost)
        if not dead or not awaited or (status is not None and status.phase is not Phase.WAITING):
            self._waits_since = None
            return False
        now = self._monotonic()
        self._waits_since = now if self._waits_since is None else self._waits_since
        return now - self._waits_since > DEAD_AGENT_TIMEOUT_S

    def _after_controller(self, controller: Child, status: int) -> Outcome | None:
        """Let the agents finish their plans, then restart the controller."""
        if not self._controller_down:
            self._controller_down = True
            self._progress.say(f"the controller died (exit status {status}): the agents finish their plans")
        if self._processes.restarts >= MAX_RESTARTS:
            return _failed(f"the controller died {MAX_RESTARTS + 1} times:\n{controller.last_lines()}")
        if self._observer.at_rest(PATIENCE_S, without=self._dead):
            self._controller_down = False
            self._processes.restarts += 1
            self._processes.start_controller()
            pid = self._processes.controller.pid if self._processes.controller else 0
            self._progress.say(f"all agents are at rest: the controller is started again ({pid})")
        return None


def _failed(text: str) -> Outcome:
    return Outcome(Ending.FAILED, text)
