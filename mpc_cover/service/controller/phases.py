"""The phases of a mission: what the controller does in each, and what leads from one to the next.

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
    """The phase that a mission is in.

    Parameters
    ----------
    supervisor, control_step, heartbeat : who is there, who plans and sends, and who tells.
    mission_clock, clock : when.
    stay : whether to keep answering after the mission is complete.
    patience_s : an agent that is awaited must have been heard within this time [s].
    listen : takes in what arrived while something took long.
    paused : whether the fleet is to wait.

    Attributes
    ----------
    phase : where the mission is.
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
        listen: Callable[[], None],
        paused: Callable[[], bool],
    ) -> None:
        self.phase, self.done = Phase.WAITING, False
        self._supervisor, self._control_step, self._heartbeat = supervisor, control_step, heartbeat
        self._mission_clock, self._clock = mission_clock, clock
        self._stay, self._patience_s, self._listen, self._paused = stay, patience_s, listen, paused
        self._flown = False

    def take_up(self, mission: Mission, law: ControlLaw, coverage: FlownMap) -> None:
        """Go on with a version of a mission, its law and its map."""
        self._law, self._coverage, self.done = law, coverage, False
        self._horizon_s = mission.spec.control.horizon_steps * mission.spec.control.period_s
        self._completion = Completion(mission, coverage, self._supervisor, self._mission_clock)

    def act(self, *, asleep: bool) -> None:
        """Do what is due in this phase; who was `asleep` itself cannot tell at once who else was silent."""
        match self.phase:
            case Phase.WAITING:
                self._wait()
            case Phase.PLANNING:
                self._plan()
            case Phase.FLYING:
                self._fly(asleep=asleep)
            case _:
                self._land()

    def enter(self, phase: Phase, text: str) -> None:
        """Go over to a phase, and tell why."""
        self.phase = phase
        self._heartbeat.text = text
        self._heartbeat.events.tell(f"phase-{phase}", text)

    def regroup(self, why: str) -> None:
        """Let everyone finish its plan, and wait for all to be at rest, for whom failures are counted anew."""
        self._control_step.failures = 0
        self.enter(Phase.WAITING, f"{why}: everyone finishes its plan and waits")

    def _wait(self) -> None:
        if self._flown:
            self._supervisor.assess(self._clock.now(), self._patience_s)
        missing = self._missing()
        if missing or self._paused():
            self._heartbeat.text = missing or "paused"
            return
        self._mission_clock.pause()
        if self._completion.nothing_left:
            self._complete()
        else:
            self.enter(Phase.PLANNING, "plans thoroughly while everyone is at rest")

    def _plan(self) -> None:
        """Plan thoroughly while everyone is at rest, and take off if all still are."""
        state = self._supervisor.at_rest(self._mission_clock.now())
        try:
            proposal, took_s = self._control_step.prepare(state, self._coverage)
        except Exception as error:  # noqa: BLE001 - a bug must not end the daemon without a word
            self.enter(Phase.FAILED, f"planning failed: {error!r}")
            return
        self._listen()
        missing = self._missing()
        if missing or self._supervisor.moved_from(state):
            self.regroup(missing or "someone moved")
            return
        self._supervisor.tell_versions()
        if not self._control_step.take_off(proposal, state, self._supervisor, took_s):
            if self._control_step.failures >= MAX_FAILURES:
                self.enter(Phase.FAILED, f"the safety filter refused {MAX_FAILURES} plans in a row")
            return
        self._flown = True
        self.enter(Phase.FLYING, "flying")

    def _missing(self) -> str:
        return "; ".join(self._supervisor.missing(self._clock.now(), self._patience_s))

    def _fly(self, *, asleep: bool) -> None:
        if not asleep and (why := self._supervisor.assess(self._clock.now(), self._patience_s)):
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

    def _land(self) -> None:
        """Nothing new is sent; wait until everyone that is heard has finished its plan."""
        staying, moving = self._stay and self.phase is Phase.COMPLETE, self._supervisor.fleet.moving(self._clock.now())
        self.done = not staying and not moving
        if staying and not moving:
            self._mission_clock.pause()
