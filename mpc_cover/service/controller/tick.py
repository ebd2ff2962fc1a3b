"""The controller daemon: one tick after another, from waiting for its agents to everyone at rest again.

    waiting -> planning -> flying -> complete
       ^------- regroup ------+----> failed

Before the first take-off it waits for everyone; after it, the others go on without whoever is lost. Ticks lie on
the grid t_k = t_0 + k T_s. The tick at t_k plans from where everyone will be at t_{k+1}, and sends what starts
then. Missed ticks are skipped; the agents fly on along their plans, which end at rest.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpc_cover.information.build import make_map
from mpc_cover.planning.budget import Budget
from mpc_cover.service.controller.commands import CommandDesk, Decision
from mpc_cover.service.controller.control_step import ControlStep
from mpc_cover.service.controller.fleet_supervisor import FleetSupervisor
from mpc_cover.service.controller.heartbeat import Heartbeat
from mpc_cover.service.controller.measurement_update import MeasurementUpdate
from mpc_cover.service.controller.mission_clock import MissionClock
from mpc_cover.service.controller.phases import MissionPhases
from mpc_cover.service.controller.plan_publisher import PlanPublisher
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


class Controller:
    """Covers a mission with the agents that report on the transport.

    Parameters
    ----------
    mission, law, transport, clock : what to do, how to plan, and the world; all handed in.
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
        self.steps = steps or StepLog()
        self.heartbeat = Heartbeat(mission, transport, clock, identity, epoch=epoch, period_s=0.5 * speed, say=say)
        self._clock, self._transport, self._epoch = clock, transport, epoch
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
        self._phases = MissionPhases(
            self.supervisor,
            self._control_step,
            self.heartbeat,
            self._mission_clock,
            clock,
            stay=stay,
            patience_s=max(PATIENCE_S * speed, 3.0 * self._control.state_period_s),
            listen=self._listen,
            paused=lambda: self._desk.paused,
        )
        self._phases.take_up(mission, law, self.coverage)

    @property
    def phase(self) -> Phase:
        """What it is doing."""
        return self._phases.phase

    @property
    def done(self) -> bool:
        """Whether nothing is left to do."""
        return self._phases.done

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
        asleep = self._clock.now() - self._mission_clock.due_s >= ASLEEP * self._control.period_s
        self._listen()
        self._obey()
        self._phases.act(asleep=asleep)
        self._beat()
        self._save()
        self._schedule()

    def shutdown(self) -> None:
        """Say that it ends, and keep what was covered; agents finish their plans by themselves."""
        self._listen()
        if self.phase not in (Phase.COMPLETE, Phase.FAILED):
            self._phases.enter(Phase.STOPPED, "stopped: everyone finishes its plan")
        self._beat()
        self._save(now=True)
        self._checkpoints.close()
        self.steps.close()

    # listening

    def _listen(self) -> None:
        self._measurements.listen()
        if (newest := self.fleet.newest_epoch()) > self._epoch and self.phase is not Phase.FAILED:
            own = f"this one, of epoch {self._epoch}"
            self._phases.enter(Phase.FAILED, f"a controller of epoch {newest} has taken over from {own}")

    def _obey(self) -> None:
        for command in self._desk.take():
            if command.name == "abort":
                self._phases.enter(Phase.FAILED, "aborted: everyone finishes its plan")
            elif command.name == "pause" and self.phase is Phase.FLYING:
                self._phases.regroup("paused")
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
            self._phases.take_up(self.mission, self.law, self.coverage)
            self._listen()  # what was heard while the law was made
            self._phases.regroup("retasked")
            self._save(now=True)
        return decision

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
