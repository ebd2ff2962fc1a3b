"""Watches a demo until it is over: processes die, are done without, or are started again."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

from mpc_cover.service.protocol.messages import Phase

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.run.daemon import Signals
    from mpc_cover.service.run.demo_processes import Processes
    from mpc_cover.service.run.observer import Observer
    from mpc_cover.service.run.processes import Child
    from mpc_cover.service.run.progress import Progress

LOOK_S = 0.1
"""How often the demo looks [s]."""
MAX_RESTARTS = 3
PATIENCE_S = 1.0
"""An agent is at rest when it said so within this time [s]."""
MOURNING_S = 3.0
"""A controller that still waits for a dead agent after this time will not do without it [s]."""
COMPLETE = "everything is covered"
PATROLLED = "the patrol is over"


def ended_well(mission: Mission) -> str:
    """Return what a flight that ended as it should begins to say: a patrol never has everything covered for good."""
    return PATROLLED if mission.spec.information and mission.spec.information.kind == "ageing" else COMPLETE


def kill_due(agents: Sequence[Child], deaths: dict[str, float], mission_time_s: float) -> None:
    """Kill whose time [s] has come, and forget its death."""
    for agent in agents:
        if mission_time_s >= deaths.get(agent.name, math.inf):
            del deaths[agent.name]
            agent.kill()


class Watch:
    """Looks until the mission is over, one way or another.

    `deaths` is at which mission time [s] agents are to be killed, by id; `monotonic` is the machine's clock,
    `over` what to say when all went well.
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
        self._bereaved = False
        self._told: list[str] = []
        self._waits_since: float | None = None

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
                kill_due(self._processes.agents, self._deaths, self._observer.status.mission_time_s)
            if (outcome := self._outcome()) is not None:
                return outcome
        return "interrupted"

    def _children(self) -> list[Child]:
        controller = self._processes.controller
        return [*([controller] if controller else []), *self._processes.agents]

    def _outcome(self) -> str | None:
        if (outcome := self._after_deaths(self._processes.dead_agents())) is not None:
            return outcome
        controller = self._processes.controller
        assert controller is not None
        match controller.exit_status:
            case None:
                return None
            case 0:
                return f"{self._over} without {', '.join(self._told)}" if self._told else self._over
            case 1:
                return "the controller gave up: " + (controller.last_lines(1) or "see its log")
            case 2:
                return "the controller could not start: " + controller.last_lines()
            case status:
                return self._after_controller(controller, status)

    def _after_deaths(self, dead: list[Child]) -> str | None:
        """Say who died; the others go on without, unless nobody is left or the controller wants everyone."""
        for agent in dead:
            if agent.name not in self._told:
                self._told.append(agent.name)
                self._progress.say(f"{agent.name} died (exit status {agent.exit_status}):\n{agent.last_lines()}")
        if len(dead) == len(self._processes.agents) or self._in_vain(dead):
            return f"{', '.join(agent.name for agent in dead)} died"
        return None

    def _in_vain(self, dead: list[Child]) -> bool:
        """Return whether the controller keeps waiting for someone who is dead, as it does before the start."""
        status = self._observer.status
        awaited = status is None or {agent.name for agent in dead} - set(status.lost)
        if not dead or not awaited or (status is not None and status.phase is not Phase.WAITING):
            self._waits_since = None
            return False
        now = self._monotonic()
        self._waits_since = now if self._waits_since is None else self._waits_since
        return now - self._waits_since > MOURNING_S

    def _after_controller(self, controller: Child, status: int) -> str | None:
        """Let the agents finish their plans, then start the controller again."""
        if not self._bereaved:
            self._bereaved = True
            self._progress.say(f"the controller died (exit status {status}): the agents finish their plans")
        if self._processes.restarts >= MAX_RESTARTS:
            return f"the controller died {MAX_RESTARTS + 1} times:\n{controller.last_lines()}"
        if self._observer.at_rest(PATIENCE_S, without=self._told):
            self._bereaved = False
            self._processes.restarts += 1
            self._processes.start_controller()
            pid = self._processes.controller.pid if self._processes.controller else 0
            self._progress.say(f"all agents are at rest: the controller is started again ({pid})")
        return None
