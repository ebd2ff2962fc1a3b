"""The state machine of a mission's phases: what the controller does in each, and the transitions between them.

waiting -> planning -> flying -> complete
^------- regroup ------+----> failed
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpc_cover.control.recovery import Mode
from mpc_cover.service.controller.completion import Completion
from mpc_cover.service.controller.plan_publisher import UnknownPlanError
from mpc_cover.service.protocol.messages import Phase

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.clock import Clock
    from mpc_cover.control.control_law import ControlLaw
    from mpc_cover.information.demand import FlownMap
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.controller.control_step import ControlStep
    from mpc_cover.service.controller.fleet_supervisor import FleetSupervisor
    from mpc_cover.service.controller.heartbeat import Heartbeat
    from mpc_cover.service.controller.mission_clock import MissionClock

MAX_FAILURES = 3
"""Steps in a row that may fail before the fleet regroups; plans of a fleet at rest, before the mission has failed."""


class MissionPhases:
    """The state machine of a mission.

    Parameters
    ----------
    supervisor, control_step, heartbeat : supervises the agents, plans and sends, and reports the phase.
    mission_clock, clock : mission time, and the controller's clock.
    stay : whether to keep answering after the mission is complete.
    patience_s : an agent must have been heard within this time to be ready [s].
    receive : takes in the reports that arrived during a long computation.
    paused : whether the fleet is to wait.
    doubts : returns further reasons why agents are not ready.

    Attributes
    ----------
    phase : the current phase.
    done : whether nothing is left to do.
    """

    def __init__(
        self,
        supervisor: FleetSupervisor,
        control_step: ControlStep,
        heartbeat: Heartbeat,
        mission_clock: MissionClock,
        clock: Clock,
        *,
        stay: bool,
        patience_s: float,
        receive: Callable[[], None],
        paused: Callable[[], bool],
        doubts: Callable[[], list[str]],
    ) -> None:
        self.phase, self.done = Phase.WAITING, False
        self._supervisor, self._control_step, self._heartbeat = supervisor, control_step, heartbeat
        self._mission_clock, self._clock = mission_clock, clock
        self._stay, self._patience_s, self._receive, self._paused = stay, patience_s, receive, paused
        self._doubts = doubts
        self._flown = self._braking = False

    def set_mission(self, mission: Mission, law: ControlLaw, coverage: FlownMap) -> None:
        """Continue with a version of the mission, its law and its map."""
        self._law, self._coverage, self.done = law, coverage, False
        self._horizon_s = mission.spec.control.horizon_s
        self._completion = Completion(mission, coverage, self._supervisor, self._mission_clock)

    def act(self, *, stalled: bool) -> None:
        """Do what is due in this phase.

        A controller that was itself `stalled` cannot tell yet which agents are silent.
        """
        self.brake()
        match self.phase:
            case Phase.WAITING:
                self._wait()
            case Phase.PLANNING:
                self._plan()
            case Phase.FLYING:
                self._fly(stalled=stalled)
            case _:
                self._wait_for_rest()

    def enter(self, phase: Phase, text: str) -> None:
        """Change to a phase, and report why."""
        self.phase = phase
        self._heartbeat.text = text
        self._heartbeat.events.emit(f"phase-{phase}", text)

    def regroup(self, why: str) -> None:
        """Let all agents finish their plans, and wait for them to be at rest; failures are counted anew then.

        A controller that has failed stays failed.
        """
        if self.phase is Phase.FAILED:
            return
        self._control_step.failures = 0
        self.enter(Phase.WAITING, f"{why}: everyone finishes its plan and waits")

    @property
    def on_grid(self) -> bool:
        """Whether a fleet in motion is controlled, on the grid of its plans."""
        return self.phase is Phase.FLYING or self._braking

    def stop(self, phase: Phase, why: str) -> None:
        """Let all agents brake as soon as that is safe, and change to a phase in which no other plan is sent.

        A controller that has failed stays so.
        """
        if self.phase is Phase.FAILED:
            return
        self._control_step.failures = 0
        self._braking = self._mission_clock.running
        self._control_step.begin_stop()
        self.enter(phase, f"{why}: everyone brakes")
        self.brake()

    def finish(self) -> None:
        """Let all agents fly their plans to the end, and end then, also where it was to stay."""
        if self.phase is not Phase.FAILED:
            self._stay = False
            self.enter(Phase.STOPPED, "finishes as asked: everyone flies its plan to its end")

    def brake(self) -> None:
        """Send a stop that was asked for, and see that everyone has it, until all are at rest."""
        if not self._braking:
            return
        if self._supervisor.settled(self._clock.now()):
            self._braking = False
            return
        try:
            self._control_step.stop(self._supervisor)
        except UnknownPlanError as error:
            self._braking = False
            text = f"someone flies an unknown plan ({error}): everyone finishes the plan that it has"
            self._heartbeat.events.emit("no-stop", text)

    def _wait(self) -> None:
        if self._flown:
            self._supervisor.assess(self._clock.now(), self._patience_s)
        not_ready = self._not_ready()
        if not_ready or self._braking:
            self._heartbeat.text = not_ready or self._heartbeat.text
            return
        self._mission_clock.pause()
        if self._paused():
            self._heartbeat.text = "paused"
            return
        if self._completion.nothing_left:
            self._complete()
        else:
            self.enter(Phase.PLANNING, "plans thoroughly while everyone is at rest")

    def _plan(self) -> None:
        """Plan thoroughly while the fleet is at rest, and take off if it still is."""
        state = self._supervisor.state_at_rest(self._mission_clock.now())
        try:
            proposal, took_s = self._control_step.prepare(state, self._coverage)
        except Exception as error:  # noqa: BLE001 - a bug must not end the daemon without a message
            self._control_step.failures += 1
            over = self._control_step.failures >= MAX_FAILURES  # the next try is a period later
            text = f"planning failed: {error!r}"
            self.enter(Phase.FAILED if over else Phase.WAITING, text if over else f"{text}; it is tried again")
            return
        self._receive()
        if self.phase is not Phase.PLANNING:  # another controller has taken over meanwhile
            return
        not_ready = self._not_ready() or ("paused" if self._paused() else "")
        if not_ready or self._supervisor.moved_since(state):
            self.regroup(not_ready or "someone moved")
            return
        self._supervisor.report_earlier_versions()
        if not self._control_step.take_off(proposal, state, self._supervisor, took_s):
            if self._control_step.failures >= MAX_FAILURES:
                self.enter(Phase.FAILED, f"the safety filter refused {MAX_FAILURES} plans in a row")
            return
        self._flown = True
        self.enter(Phase.FLYING, "flying")

    def _not_ready(self) -> str:
        return "; ".join([*self._supervisor.not_ready(self._clock.now(), self._patience_s), *self._doubts()])

    def _fly(self, *, stalled: bool) -> None:
        if not stalled and (why := self._supervisor.assess(self._clock.now(), self._patience_s)):
            self.regroup(why)
            return
        if self._over():
            return
        try:
            self._control_step.step(self._supervisor, self._coverage)
        except UnknownPlanError as error:
            self.regroup(f"someone flies an unknown plan ({error})")
            return
        if self._control_step.failures >= MAX_FAILURES:
            self.regroup(f"{self._control_step.failures} steps failed")
        elif self._law.mode is Mode.REPLAN_AT_REST and self._control_step.sent:
            self.regroup("a step is too short to plan anew")

    def _over(self) -> bool:
        """Return whether there is nothing to send: all covered and at rest, or out of time."""
        if (ending := self._completion.out_of_time()) is not None:
            self.enter(*ending)
            return True
        if not self._completion.nothing_left:
            return False
        now = self._clock.now()
        if self._supervisor.settled(now):
            self._mission_clock.pause()
            self._complete()
            return True
        return self._completion.since_s(now) > self._horizon_s

    def _complete(self) -> None:
        self.enter(*self._completion.ending())
        self.done = self.phase is Phase.COMPLETE and not self._stay

    def _wait_for_rest(self) -> None:
        """Send nothing; wait until all agents that are heard have finished their plans."""
        staying = self._stay and self.phase is Phase.COMPLETE
        moving = self._supervisor.monitor.moving(self._clock.now())
        self.done = not staying and not moving
        if self.phase is Phase.STOPPED and not moving and self._completion.nothing_left:
            self.enter(*self._completion.ending())
        if staying and not moving:
            self._mission_clock.pause()
