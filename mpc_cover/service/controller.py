"""The controller daemon: one tick after another, from waiting for its agents to everyone at rest again.

    waiting -> planning -> flying -> complete
       ^------- regroup ------+----> failed

Ticks lie on the grid t_k = t_0 + k T_s. The tick at t_k plans from where everyone will be at t_{k+1}, and
sends what starts then. Missed ticks are skipped; the agents fly on along their plans, which end at rest.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.service.commands import CommandDesk
from mpc_cover.service.dispatch import Dispatch, UnknownPlanError
from mpc_cover.service.heartbeat import Heartbeat
from mpc_cover.service.journal import NoJournal
from mpc_cover.service.keys import Keys
from mpc_cover.service.messages import Phase
from mpc_cover.service.step_log import Step, StepLog
from mpc_cover.service.survey import Survey
from mpc_cover.service.timeline import Timeline

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.clock import Clock
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.brain import Brain, StepOutcome
    from mpc_cover.service.bus import Transport
    from mpc_cover.service.journal import Journal, Snapshot

PATIENCE_S = 1.0
"""An agent that is awaited must have been heard within this time of the machine's clock [s]."""
LOST_AFTER = 0.5
"""Part of the horizon that an agent may be silent for before the fleet regroups."""
LATEST_START = 0.5
"""Part of the time for a step that must be left when it starts, or it is skipped."""
MAX_FAILURES = 3
"""Steps in a row that may raise before the fleet regroups."""
MOVED_M = 1e-4
"""Whoever moved further than this during the planning was not at rest [m]."""


class Controller:
    """Covers a mission with the agents that report on the transport.

    Parameters
    ----------
    mission, brain, transport, clock : what to do, how to think, and the world; all handed in.
    epoch, identity : whose plans agents are to follow; a later controller has a higher epoch.
    speed : how many seconds of `clock` pass in one of the machine's.
    deadlines : whether steps have one; without, runs are deterministic.
    stay : whether to keep answering after the mission is complete.
    journal : keeps what was covered; `resume` is what an earlier controller kept, and what was measured since
        is asked of the agents.
    say : told events in words.
    """

    def __init__(
        self,
        mission: Mission,
        brain: Brain,
        transport: Transport,
        clock: Clock,
        *,
        epoch: int = 1,
        identity: str = "controller",
        speed: float = 1.0,
        deadlines: bool = True,
        stay: bool = False,
        journal: Journal | None = None,
        resume: Snapshot | None = None,
        steps: StepLog | None = None,
        say: Callable[[str], None] | None = None,
    ) -> None:
        self.mission, self.brain = mission, brain
        self.phase = Phase.WAITING
        self.done = False
        self.steps = steps or StepLog()
        self.heartbeat = Heartbeat(mission, transport, clock, identity, epoch=epoch, period_s=0.5 * speed, say=say)
        self._clock, self._transport, self._epoch = clock, transport, epoch
        self._control = mission.spec.control
        self._speed, self._deadlines, self._stay = speed, deadlines, stay
        self._journal: Journal = journal or NoJournal()
        self._dispatch = Dispatch(mission, transport, epoch, identity)
        self._desk = CommandDesk(mission, transport)
        self._timeline = Timeline(clock, self._control.period_s, resume.mission_time_s if resume else 0.0)
        self._survey = Survey(mission, transport, brain.coverage, self._timeline, speed=speed, resume=resume)
        self.fleet = self._survey.fleet
        self._patience = max(PATIENCE_S * speed, 3.0 * self._control.state_period_s)
        self._failures = 0
        self._complete_s = np.inf

    @property
    def next_time(self) -> float:
        """When the next tick is due [s]."""
        return self._timeline.due_s

    @property
    def exit_status(self) -> int:
        """0 when the mission is complete, else 1."""
        return 0 if self.phase is Phase.COMPLETE else 1

    def startup(self) -> None:
        """Show presence."""
        self._transport.announce(Keys(self.mission.spec.name).controller_alive)
        self._beat()

    def tick(self) -> None:
        """Listen, act according to the phase, and give the heartbeat of a finished tick."""
        self._listen()
        self._obey()
        match self.phase:
            case Phase.WAITING:
                self._wait()
            case Phase.PLANNING:
                self._plan()
            case Phase.FLYING:
                self._fly()
            case _:
                self._land()
        self._beat()
        self._save()
        self._schedule()

    def shutdown(self) -> None:
        """Say that it ends, and keep what was covered; agents finish their plans by themselves."""
        self._listen()
        if self.phase not in (Phase.COMPLETE, Phase.FAILED):
            self._enter(Phase.STOPPED, "stopped: everyone finishes its plan")
        self._beat()
        self._save(now=True)
        self._journal.close()
        self.steps.close()

    # listening

    def _listen(self) -> None:
        self._survey.listen()
        if self.fleet.reborn and self.phase is Phase.FLYING:
            self._regroup(f"{', '.join(self.fleet.reborn)} started anew")
        if (newest := self.fleet.newest_epoch()) > self._epoch and self.phase is not Phase.FAILED:
            own = f"this one, of epoch {self._epoch}"
            self._enter(Phase.FAILED, f"a controller of epoch {newest} has taken over from {own}")

    def _obey(self) -> None:
        for command in self._desk.take():
            if command == "abort":
                self._enter(Phase.FAILED, "aborted: everyone finishes its plan")
            elif command == "pause" and self.phase is Phase.FLYING:
                self._regroup("paused")

    # the phases

    def _enter(self, phase: Phase, text: str) -> None:
        self.phase = phase
        self.heartbeat.text = text
        self.heartbeat.events.tell(f"phase-{phase}", text)

    def _regroup(self, why: str) -> None:
        self._enter(Phase.WAITING, f"{why}: everyone finishes its plan and waits")

    def _wait(self) -> None:
        missing = self.fleet.awaited(self._clock.now(), self._patience)
        if missing or self._desk.paused:
            self.heartbeat.text = "; ".join(missing) or "paused"
            return
        self._timeline.pause()
        if self.brain.coverage.complete:
            self._complete()
        else:
            self._enter(Phase.PLANNING, "plans thoroughly while everyone is at rest")

    def _plan(self) -> None:
        """Plan thoroughly, pin mission time to the clock, and send the first plan a period ahead of its start."""
        before = time.perf_counter()
        deadline = before + self._control.planning_time_s if self._deadlines else None
        position, velocity = self.fleet.state()
        try:
            result = self.brain.prepare(position, velocity, self._timeline.now(), deadline=deadline)
        except Exception as error:  # noqa: BLE001 - a bug must not end the daemon without a word
            self._enter(Phase.FAILED, f"planning failed: {error!r}")
            return
        self._listen()
        missing = self.fleet.awaited(self._clock.now(), self._patience)
        if missing or np.abs(self.fleet.state()[0] - position).max() > MOVED_M:
            self._regroup("; ".join(missing) or "someone moved")
            return
        self._take_off(result)
        self._note(result, time.perf_counter() - before, "prepare")

    def _take_off(self, result: StepOutcome) -> None:
        self.fleet.freeze_clocks()
        self._timeline.start(self._clock.now() + self._control.period_s)
        self._failures = 0
        self._dispatch.forget()
        self._send(result)
        self._enter(Phase.FLYING, "flying")

    def _fly(self) -> None:
        if self._over() or self._lost():
            return
        now, tick = self._clock.now(), self._timeline.tick
        budget = self._control.deadline_fraction * self._control.period_s
        left = self._timeline.grid(tick) + budget - now
        if self._deadlines and left < LATEST_START * budget:
            self.steps.skipped += 1
            return
        before = time.perf_counter()
        try:
            position, velocity = self._dispatch.predict(self.fleet.links, self._timeline.grid(tick + 1))
        except UnknownPlanError as error:
            self._regroup(f"someone flies an unknown plan ({error})")
            return
        deadline = before + left / self._speed if self._deadlines else None
        start = self._timeline.planned_start(tick + 1)
        try:
            result = self.brain.step(position, velocity, start, deadline=deadline)
        except Exception as error:  # noqa: BLE001 - agents fly on along their verified plans
            self._fail(error)
            return
        self._failures = 0
        self._send(result)
        self._note(result, time.perf_counter() - before, "step")

    def _fail(self, error: Exception) -> None:
        self._failures += 1
        self.heartbeat.events.tell("step-failed", f"a step failed: {error!r}; the previous plan goes on")
        if self._failures >= MAX_FAILURES:
            self._regroup(f"{self._failures} steps failed")

    def _over(self) -> bool:
        """Return whether there is nothing to send: all covered and at rest, or out of time."""
        now, limit, horizon = self._clock.now(), self._control.time_limit_s, self._horizon_s
        if not self.brain.coverage.complete:
            if self._timeline.now() <= limit:
                return False
            owed = self.mission.field.size - self.brain.coverage.covered_count
            self._enter(Phase.FAILED, f"{owed} cells are not covered after control.time_limit_s {limit:g} s")
            return True
        self._complete_s = min(self._complete_s, now)
        if not self.fleet.late(now) and self._settled():
            self._timeline.pause()
            self._complete()
            return True
        return now > self._complete_s + horizon  # whoever still hovers finishes its plan now

    def _settled(self) -> bool:
        try:
            return self._dispatch.settled(self.fleet.links)
        except UnknownPlanError:
            return False

    def _complete(self) -> None:
        self._enter(Phase.COMPLETE, "everything is covered and everyone is at rest")
        self.done = not self._stay

    def _lost(self) -> bool:
        patience = LOST_AFTER * self._horizon_s
        if lost := self.fleet.late(self._clock.now(), patience):
            self._regroup(f"{', '.join(lost)} not heard for {patience:g} s")
        return bool(lost)

    def _land(self) -> None:
        """Nothing new is sent; wait until everyone that is heard has finished its plan."""
        staying = self._stay and self.phase is Phase.COMPLETE
        self.done = not staying and not self.fleet.moving(self._clock.now())

    # what a tick leaves behind

    @property
    def _horizon_s(self) -> float:
        return self._control.horizon_steps * self._control.period_s

    def _send(self, result: StepOutcome) -> None:
        self._dispatch.send(result.plan, self.fleet.links, self._timeline.origin_s, self._clock.now())

    def _note(self, result: StepOutcome, tick_time_s: float, kind: str) -> None:
        self.steps.add(
            Step(
                kind,
                result.plan.start_time,
                result.computing_time_s,
                tick_time_s,
                result.rung.name,
                result.reason,
                result.deadline_missed,
            )
        )

    def _beat(self) -> None:
        self.heartbeat.beat(self.phase, self._timeline.now(), self.brain.coverage, self.steps, self.fleet)
        self._desk.answer(self.phase)

    def _save(self, *, now: bool = False) -> None:
        finished = self.phase is Phase.COMPLETE
        snapshot = self._survey.snapshot(finished=finished)
        if problem := self._journal.save(snapshot, now=now or finished):
            self.heartbeat.events.tell("journal", problem)

    def _schedule(self) -> None:
        if self.phase is Phase.FLYING:
            self.steps.skipped += self._timeline.next_tick()
        else:
            self._timeline.next_wait(0.0 if self.phase is Phase.PLANNING else self._control.period_s)
