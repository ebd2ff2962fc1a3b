"""The controller daemon: it ticks from waiting for its agents until the mission is over and they are at rest again.

    waiting -> planning -> flying -> complete
       ^------- regroup ------+----> failed

Before the first take-off it waits for all agents; after it, the fleet goes on without agents that are lost. Ticks lie
on the grid t_k = t_0 + k T_s. The tick at t_k plans from the predicted state at t_{k+1}, and sends plans that start
then. Missed ticks are skipped; the agents fly on along their plans, which end at rest.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from mpc_cover.exit_status import exit_status
from mpc_cover.information.build import make_map
from mpc_cover.model.trajectory import SNAP_S
from mpc_cover.planning.budget import Budget
from mpc_cover.service.controller.commands import CommandServer, Decision
from mpc_cover.service.controller.control_step import ControlStep
from mpc_cover.service.controller.epochs import Claim, EpochWatch
from mpc_cover.service.controller.fleet_supervisor import FleetSupervisor
from mpc_cover.service.controller.flight_record import FlightRecord
from mpc_cover.service.controller.heartbeat import Heartbeat
from mpc_cover.service.controller.measurement_update import MeasurementUpdate
from mpc_cover.service.controller.mission_clock import MissionClock
from mpc_cover.service.controller.phases import MissionPhases
from mpc_cover.service.controller.plan_publisher import PlanPublisher
from mpc_cover.service.controller.retask import consider_retask
from mpc_cover.service.controller.snapshot import NoCheckpoints
from mpc_cover.service.controller.step_log import StepLog
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.protocol.messages import CommandName, Phase

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mpc_cover.clock import Clock
    from mpc_cover.control.control_law import ControlLaw
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.agent.recorder import Recorder
    from mpc_cover.service.controller.snapshot import CheckpointStore, Snapshot
    from mpc_cover.service.protocol.bus import Transport

PATIENCE_S = 1.0
"""An agent must have been heard within this time of the machine's clock to be ready [s]."""
STALLED_PERIODS = 2
"""A controller that is so many periods late was stalled itself: it cannot tell yet which agents are silent."""


class Controller:
    """Covers a mission with the agents that report on the transport.

    Parameters
    ----------
    mission, law : the mission, and the control law that plans it.
    transport, clock : the network, and the controller's clock.
    epoch, identity : identify the controller to the agents; a later controller has a higher epoch.
    speed : how many seconds of `clock` pass in one of the machine's.
    budget_of : makes the budget of a step from its seconds of the machine's: of time, or of counted work, with which
        runs are deterministic.
    stay : whether to keep answering after the mission is complete.
    checkpoints, resume : keeps snapshots of the progress; the snapshot of an earlier controller to resume from. What
        was measured since is requested from the agents.
    law_for : returns a control law for a mission; without it retasks are refused.
    versions : fingerprints of earlier versions of the mission.
    step_log : records the control steps.
    say : called with the text of each event.
    recorders : record each agent's motion, as far as the controller knows it; none where left out.
    keep_epoch : keeps a higher epoch that the controller takes because agents have seen its own, for its successors; it
        may raise an OSError.

    Attributes
    ----------
    mission, law, coverage : the current version of the mission, its control law and its map.
    fleet_monitor : the agents' reports.
    supervisor : which agents are lost.
    heartbeat : status and events.
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
        step_log: StepLog | None = None,
        say: Callable[[str], None] | None = None,
        recorders: Sequence[Recorder] = (),
        keep_epoch: Callable[[int], None] | None = None,
    ) -> None:
        self.mission, self.law = mission, law
        self.step_log = step_log or StepLog()
        self.heartbeat = Heartbeat(mission, transport, clock, identity, epoch=epoch, period_s=0.5 * speed, say=say)
        self._clock, self._transport, self._identity = clock, transport, identity
        self._epochs, self._keep_epoch = EpochWatch(mission.spec.name, transport, identity, epoch), keep_epoch
        self._told_others: dict[str, str] = {}
        self._control = mission.spec.control
        self._checkpoints: CheckpointStore = checkpoints or NoCheckpoints()
        self._commands = CommandServer(mission, transport, identity)
        self._mission_clock = MissionClock(clock, self._control.period_s, resume.mission_time_s if resume else 0.0)
        self.coverage = make_map(mission)
        self._measurements = MeasurementUpdate(
            mission, transport, self.coverage, self._mission_clock, speed=speed, resume=resume
        )
        self.fleet_monitor, self._law_for = self._measurements.monitor, law_for
        self.fleet_monitor.earlier_versions = list(versions)
        self.fleet_monitor.identity = identity
        self._publisher = PlanPublisher(mission, transport, epoch, identity)
        self._record = FlightRecord(recorders, mission.fleet, self._publisher.find) if recorders else None
        self.fleet_monitor.on_state = self._record.add if self._record else None
        self.supervisor = FleetSupervisor(
            mission,
            self.fleet_monitor,
            self._publisher,
            resume.lost if resume else {},
            self.heartbeat.events.emit,
            tolerates_losses=law.tolerates_losses,
        )
        self._control_step = ControlStep(
            law,
            self._publisher,
            self._mission_clock,
            clock,
            self._control,
            self.step_log,
            speed=speed,
            budget_of=budget_of,
            emit=self.heartbeat.events.emit,
        )
        self._phases = MissionPhases(
            self.supervisor,
            self._control_step,
            self.heartbeat,
            self._mission_clock,
            clock,
            stay=stay,
            patience_s=max(PATIENCE_S * speed, 3.0 * self._control.state_period_s),
            receive=self._receive,
            paused=lambda: self._commands.paused,
            doubts=lambda: self._epochs.doubts(self.supervisor.lost),
        )
        self._phases.set_mission(mission, law, self.coverage)

    @property
    def phase(self) -> Phase:
        """The phase of the mission."""
        return self._phases.phase

    @property
    def done(self) -> bool:
        """Whether nothing is left to do."""
        return self._phases.done

    @property
    def next_time(self) -> float:
        """When the next tick is due [s]: in flight at once when everyone is told to brake."""
        due_s = self._mission_clock.due_s
        return min(due_s, self._clock.now()) if self._phases.on_grid and self._commands.waiting else due_s

    @property
    def exit_status(self) -> int:
        """0 when the mission is complete, else 1."""
        return exit_status(covered=self.phase is Phase.COMPLETE)

    @property
    def mission_time_s(self) -> float:
        """Time since the first take-off, without the time at rest between flights [s]."""
        return self._mission_clock.now()

    def startup(self) -> None:
        """Announce presence."""
        keys = Keys(self.mission.spec.name)
        self._transport.announce(keys.controller_alive)
        self._transport.announce(keys.controller_instance(self._identity))
        self._publish_status()

    def tick(self) -> None:
        """Receive reports and commands, act according to the phase, and publish the status.

        When it is told to brake between two ticks of a flight, it only executes that.
        """
        now_s = self._clock.now()
        if self._phases.on_grid and self._commands.waiting and now_s < self._mission_clock.due_s - SNAP_S:
            self._execute_commands()
            self._publish_status()
            return
        stalled = now_s - self._mission_clock.due_s >= STALLED_PERIODS * self._control.period_s
        self._receive()
        self._execute_commands()
        self._phases.act(stalled=stalled)
        self._publish_status()
        self._save()
        self._schedule()

    def idle(self, until_s: float) -> None:
        """Improve the rest of the plan until a time of the clock [s], as far as the mission allows."""
        if self.phase is Phase.FLYING and not self._commands.waiting:
            self._control_step.improve(until_s - self._clock.now())

    def shutdown(self) -> None:
        """Report that it ends, and save the progress; agents finish their plans by themselves."""
        self._receive()
        if self.phase not in (Phase.COMPLETE, Phase.FAILED):
            self._phases.enter(Phase.STOPPED, "stopped: everyone finishes its plan")
        self._publish_status()
        self._save(now=True)
        self._checkpoints.close()
        self.step_log.close()
        if self._record is not None:
            self._record.close(self.fleet_monitor.links, self._clock.now())

    def _receive(self) -> None:
        self._measurements.update()
        self._compare_epochs()
        for name, other in self.fleet_monitor.others.items():
            if self._told_others.get(name) != other:
                self._told_others[name] = other
                text = f"instance {other[:8]} says that it is {name}, too: it is not listened to while {name} is here"
                self.heartbeat.events.emit(f"twice-{name}"[:64], text)
        for error in self.fleet_monitor.not_genuine:
            self.heartbeat.events.emit("state-refused", f"ignores a state: {error}")

    def _compare_epochs(self) -> None:
        """Withdraw before a controller of a higher epoch; where only its epoch is left, take the next one."""
        states = [link.state for link in self.fleet_monitor.links if link.state]
        if self.phase is Phase.FAILED or (verdict := self._epochs.look(states)) is None:
            return
        own = f"this one, of epoch {self._epochs.epoch}"
        if verdict.claim is Claim.WITHDRAW:
            self._phases.enter(Phase.FAILED, f"a controller of epoch {verdict.epoch} has taken over from {own}")
            return
        why = f"agents have seen epoch {verdict.epoch - 1}, and no other controller is here"
        self._epochs.take(verdict.epoch)
        self._publisher.epoch = self.heartbeat.epoch = verdict.epoch
        self.heartbeat.events.emit("epoch", f"{why}: {own}, goes on as epoch {verdict.epoch}")
        if self._keep_epoch is None:
            return
        try:
            self._keep_epoch(verdict.epoch)
        except OSError as error:
            self.heartbeat.events.emit("epoch-kept", f"epoch {verdict.epoch} cannot be written: {error.strerror}")

    def _execute_commands(self) -> None:
        commands = self._commands.receive()
        for error in self._commands.take_refused():
            self.heartbeat.events.emit("command-refused", f"ignores a command: {error}")
        for command in commands:
            match command.name:
                case CommandName.ABORT:
                    self._phases.stop(Phase.FAILED, "aborted")
                case CommandName.PAUSE if self._mission_clock.running:
                    self._phases.stop(Phase.WAITING if self.phase is Phase.FLYING else self.phase, "paused")
                case CommandName.FINISH:
                    self._phases.finish()
                case CommandName.RETASK:
                    self._commands.decide(command, self._retask(command.mission))

    def _retask(self, text: str) -> Decision:
        """Continue with another version of the mission: its map at once, its plans once the fleet is at rest."""
        if self._law_for is None or self.phase is Phase.FAILED:
            return Decision(accepted=False, text=f"refused: there is no going on: {self.heartbeat.text}")
        now_s = self._mission_clock.now()
        retask, decision = consider_retask(text, self.mission, self.coverage, now_s, self._law_for)
        if retask is not None:
            self.mission, self.law, self.coverage = retask.mission, retask.law, retask.coverage
            self._control = self.mission.spec.control
            self._measurements.set_mission(self.mission, self.coverage)
            self.supervisor.set_mission(self.mission)
            self._publisher.set_mission(self.mission)
            self._control_step.set_law(self.law, self._control)
            self._checkpoints.set_mission(self.mission)
            self._phases.set_mission(self.mission, self.law, self.coverage)
            self._receive()  # reports that arrived while the law was made
            self._phases.regroup("retasked")
            self._save(now=True)
        return decision

    def _publish_status(self) -> None:
        now, lost = self._mission_clock.now(), self.supervisor.lost
        self.heartbeat.publish(self.phase, now, self.coverage, self.step_log, self.fleet_monitor, lost)
        self._commands.answer(self.phase)

    def _save(self, *, now: bool = False) -> None:
        finished = self.phase is Phase.COMPLETE
        snapshot = self._measurements.snapshot(self.supervisor.lost_positions(), finished=finished)
        snapshot = replace(snapshot, epoch=self._epochs.epoch)
        if problem := self._checkpoints.save(snapshot, now=now or finished):
            self.heartbeat.events.emit("checkpoint", problem)

    def _schedule(self) -> None:
        if self._phases.on_grid:
            self.step_log.skipped += self._mission_clock.next_tick()
        else:
            self._mission_clock.next_wait(0.0 if self.phase is Phase.PLANNING else self._control.period_s)
