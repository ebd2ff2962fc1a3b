"""The controller daemon: one tick after another, from waiting for its agents to everyone at rest again.

    waiting -> planning -> flying -> complete
       ^------- regroup ------+----> failed

Before the first take-off it waits for everyone; after it, the others go on without whoever is lost. Ticks lie on
the grid t_k = t_0 + k T_s. The tick at t_k plans from where everyone will be at t_{k+1}, and sends what starts
then. Missed ticks are skipped; the agents fly on along their plans, which end at rest.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from mpc_cover.control.recovery import Mode
from mpc_cover.information.build import make_map
from mpc_cover.planning.budget import Budget
from mpc_cover.service.controller.commands import CommandDesk, Decision
from mpc_cover.service.controller.control_step import ControlStep
from mpc_cover.service.controller.fleet_supervisor import FleetSupervisor
from mpc_cover.service.controller.heartbeat import Heartbeat
from mpc_cover.service.controller.measurement_update import MeasurementUpdate
from mpc_cover.service.controller.mission_clock import MissionClock
from mpc_cover.service.controller.plan_publisher import PlanPublisher, UnknownPlanError
from mpc_cover.service.controller.retask import consider_retask
from mpc_cover.service.controller.snapshot import NoCheckpoints
from mpc_cover.service.controller.step_log import StepLog
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.protocol.messages import Phase

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mpc_cover.clock import Clock
    from mpc_cover.control.control_law import ControlLaw
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.controller.snapshot import CheckpointStore, Snapshot
    from mpc_cover.service.protocol.bus import Transport

PATIENCE_S = 1.0
"""An agent that is awaited must have been heard within this time of the machine's clock [s]."""
ASLEEP = 2
"""Whoever is so many periods late cannot tell at once who else was silent."""
MAX_FAILURES = 3
"""Steps in a row that may raise before the fleet regroups."""


class Controller:
    """Covers a mission with the agents that report on the transport.

    Parameters
    ----------
    mission, brain, transport, clock : what to do, how to think, and the world; all handed in.
    epoch, identity : whose plans agents are to follow; a later controller has a higher epoch.
    speed : how many seconds of `clock` pass in one of the machine's.
    budget_of : makes the budget of a step from its seconds of the machine's: of time, or of counted work, with which
        runs are deterministic.
    stay : whether to keep answering after the mission is complete.
    law_for : returns a control law for a mission; without, no other version of it can be taken up. `versions` are the
        fingerprints of earlier ones.
    checkpoints : keeps what was covered; `resume` is what an earlier controller kept, and what was measured since
        is asked of the agents.
    say : told events in words.
    """

    def __init__(
        self,
        mission: Mission,
        law: ControlLaw,
        transport: Transport,
        clock: Clock,
        *,
        epoch: int = 1,
        identity: str = "controller",
        speed: float = 1.0,
        budget_of: Callable[[float], Budget] = Budget.wall_clock,
        stay: bool = False,
        checkpoints: CheckpointStore | None = None,
        resume: Snapshot | None = None,
        law_for: Callable[[Mission], ControlLaw] | None = None,
        versions: Sequence[str] = (),
        steps: StepLog | None = None,
        say: Callable[[str], None] | None = None,
    ) -> None:
        self.mission, self.law = mission, law
        self.phase = Phase.WAITING
        self.done = False
        self.steps = steps or StepLog()
        self.heartbeat = Heartbeat(mission, transport, clock, identity, epoch=epoch, period_s=0.5 * speed, say=say)
        self._clock, self._transport, self._epoch, self._stay = clock, transport, epoch, stay
        self._control = mission.spec.control
        self._checkpoints: CheckpointStore = checkpoints or NoCheckpoints()
        self._desk = CommandDesk(mission, transport)
        self._mission_clock = MissionClock(clock, self._control.period_s, resume.mission_time_s if resume else 0.0)
        self.coverage = make_map(mission)
        self._measurements = MeasurementUpdate(
            mission, transport, self.coverage, self._mission_clock, speed=speed, resume=resume
        )
        self.fleet, self._law_for = self._measurements.fleet, law_for
        self.fleet.earlier_versions = list(versions)
        self._publisher = publisher = PlanPublisher(mission, transport, epoch, identity)
        tell = self.heartbeat.events.tell
        rests = resume.lost if resume else {}
        self.supervisor = FleetSupervisor(
            mission, self.fleet, publisher, rests, tell, tolerates_losses=law.tolerates_losses
        )
        self._control_step = ControlStep(
            law,
            publisher,
            self._mission_clock,
            clock,
            self._control,
            self.steps,
            speed=speed,
            budget_of=budget_of,
            tell=tell,
        )
        self._patience = max(PATIENCE_S * speed, 3.0 * self._control.state_period_s)
        self._flown = self._asleep = False
        self._complete_s = math.inf

    @property
    def next_time(self) -> float:
        """When the next tick is due [s]."""
        return self._mission_clock.due_s

    @property
    def exit_status(self) -> int:
        """0 when the mission is complete, else 1."""
        return 0 if self.phase is Phase.COMPLETE else 1

    @property
    def mission_time_s(self) -> float:
        """Since the first take-off, without the time on the ground [s]."""
        return self._mission_clock.now()

    def startup(self) -> None:
        """Show presence."""
        self._transport.announce(Keys(self.mission.spec.name).controller_alive)
        self._beat()

    def tick(self) -> None:
        """Listen, act according to the phase, and give the heartbeat of a finished tick."""
        self._asleep = self._clock.now() - self._mission_clock.due_s >= ASLEEP * self._control.period_s
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
        self._checkpoints.close()
        self.steps.close()

    # listening

    def _listen(self) -> None:
        self._measurements.listen()
        if (newest := self.fleet.newest_epoch()) > self._epoch and self.phase is not Phase.FAILED:
            own = f"this one, of epoch {self._epoch}"
            self._enter(Phase.FAILED, f"a controller of epoch {newest} has taken over from {own}")

    def _obey(self) -> None:
        for command in self._desk.take():
            if command.name == "abort":
                self._enter(Phase.FAILED, "aborted: everyone finishes its plan")
            elif command.name == "pause" and self.phase is Phase.FLYING:
                self._regroup("paused")
            elif command.name == "retask":
                self._desk.decide(command, self._retask(command.mission))

    def _retask(self, text: str) -> Decision:
        """Go on with another version of the mission: its map at once, its plans once everyone is at rest."""
        if self._law_for is None or self.phase is Phase.FAILED:
            return Decision(accepted=False, text=f"refused: there is no going on: {self.heartbeat.text}")
        now_s = self._mission_clock.now()
        retask, decision = consider_retask(text, self.mission, self.coverage, now_s, self._law_for)
        if retask is not None:
            self.mission, self.law, self.coverage = retask.mission, retask.law, retask.coverage
            self._control = self.mission.spec.control
            self._measurements.take_up(self.mission, self.coverage)
            self.supervisor.take_up(self.mission)
            self._publisher.take_up(self.mission)
            self._control_step.take_up(self.law, self._control)
            self._checkpoints.take_up(self.mission)
            self._complete_s, self.done = math.inf, False
            self._listen()  # what was heard while the law was made
            self._regroup("retasked")
            self._save(now=True)
        return decision

    # the phases

    def _enter(self, phase: Phase, text: str) -> None:
        self.phase = phase
        self.heartbeat.text = text
        self.heartbeat.events.tell(f"phase-{phase}", text)

    def _regroup(self, why: str) -> None:
        self._enter(Phase.WAITING, f"{why}: everyone finishes its plan and waits")

    def _wait(self) -> None:
        if self._flown:
            self.supervisor.assess(self._clock.now(), self._patience)
        missing = self._missing()
        if missing or self._desk.paused:
            self.heartbeat.text = missing or "paused"
            return
        self._mission_clock.pause()
        if self._nothing_left:
            self._complete()
        else:
            self._enter(Phase.PLANNING, "plans thoroughly while everyone is at rest")

    def _plan(self) -> None:
        """Plan thoroughly while everyone is at rest, and take off if all still are."""
        state = self.supervisor.at_rest(self._mission_clock.now())
        try:
            proposal, took_s = self._control_step.prepare(state, self.coverage)
        except Exception as error:  # noqa: BLE001 - a bug must not end the daemon without a word
            self._enter(Phase.FAILED, f"planning failed: {error!r}")
            return
        self._listen()
        missing = self._missing()
        if missing or self.supervisor.moved_from(state):
            self._regroup(missing or "someone moved")
            return
        self.supervisor.tell_versions()
        if not self._control_step.take_off(proposal, state, self.supervisor, took_s):
            if self._control_step.failures >= MAX_FAILURES:
                self._enter(Phase.FAILED, f"the safety filter refused {MAX_FAILURES} plans in a row")
            return
        self._flown = True
        self._enter(Phase.FLYING, "flying")

    def _missing(self) -> str:
        return "; ".join(self.supervisor.missing(self._clock.now(), self._patience))

    def _fly(self) -> None:
        if not self._asleep and (why := self.supervisor.assess(self._clock.now(), self._patience)):
            self._regroup(why)
            return
        if self._over():
            return
        try:
            self._control_step.step(self.supervisor, self.coverage)
        except UnknownPlanError as error:
            self._regroup(f"someone flies an unknown plan ({error})")
            return
        if self._control_step.failures >= MAX_FAILURES:
            self._regroup(f"{self._control_step.failures} steps failed")
        elif self.law.mode is Mode.REPLAN_AT_REST and self._control_step.sent:
            self._regroup("a step is too short to plan anew")

    @property
    def _nothing_left(self) -> bool:
        """Whether all that can be measured has been: everything, unless only the lost could have measured the rest."""
        return self.coverage.complete or not (self.coverage.owed & self.supervisor.reachable).any()

    def _over(self) -> bool:
        """Return whether there is nothing to send: all covered and at rest, or out of time."""
        now, limit = self._clock.now(), self._control.time_limit_s
        horizon = self._control.horizon_steps * self._control.period_s
        if not self._nothing_left:
            if self._mission_clock.now() <= limit:
                return False
            if self.coverage.endless:
                self._enter(Phase.COMPLETE, f"the patrol ends after control.time_limit_s {limit:g} s")
                return True
            owed = self.mission.field.size - self.coverage.covered_count
            self._enter(Phase.FAILED, f"{owed} cells are not covered after control.time_limit_s {limit:g} s")
            return True
        self._complete_s = min(self._complete_s, now)
        if self.supervisor.settled(now):
            self._mission_clock.pause()
            self._complete()
            return True
        return now > self._complete_s + horizon  # whoever still hovers finishes its plan now

    def _complete(self) -> None:
        lost = ", ".join(self.supervisor.lost)
        if not self.coverage.complete:
            owed = self.mission.field.size - self.coverage.covered_count
            text = f"{owed} cells are not covered, and cannot be without {lost}: all else is, and everyone is at rest"
            self._enter(Phase.FAILED, text)
            return
        rest = f", and everyone but {lost}" if lost else " and everyone"
        self._enter(Phase.COMPLETE, f"everything is covered{rest} is at rest")
        self.done = not self._stay

    def _land(self) -> None:
        """Nothing new is sent; wait until everyone that is heard has finished its plan."""
        staying, moving = self._stay and self.phase is Phase.COMPLETE, self.fleet.moving(self._clock.now())
        self.done = not staying and not moving
        if staying and not moving:
            self._mission_clock.pause()

    # what a tick leaves behind

    def _beat(self) -> None:
        now, coverage = self._mission_clock.now(), self.coverage
        self.heartbeat.beat(self.phase, now, coverage, self.steps, self.fleet, self.supervisor.lost)
        self._desk.answer(self.phase)

    def _save(self, *, now: bool = False) -> None:
        finished = self.phase is Phase.COMPLETE
        snapshot = self._measurements.snapshot(self.supervisor.resting_places(), finished=finished)
        if problem := self._checkpoints.save(snapshot, now=now or finished):
            self.heartbeat.events.tell("journal", problem)

    def _schedule(self) -> None:
        if self.phase is Phase.FLYING:
            self.steps.skipped += self._mission_clock.next_tick()
        else:
            self._mission_clock.next_wait(0.0 if self.phase is Phase.PLANNING else self._control.period_s)
