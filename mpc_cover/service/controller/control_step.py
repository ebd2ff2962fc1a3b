"""One control step: state prediction, control law, safety filter and publication, within its time budget.

If the law fails, is too late, or proposes a plan that the filter refuses, the previous plan stays in force.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from mpc_cover.control.control_law import ImprovesWhenIdle, PlanSource, Proposal
from mpc_cover.model.trajectory import SNAP_S
from mpc_cover.service.controller.step_log import Step, StepKind

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.clock import Clock
    from mpc_cover.control.control_law import ControlLaw
    from mpc_cover.information.demand import FlownMap
    from mpc_cover.mission.config import Control
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.planning.budget import Budget
    from mpc_cover.service.controller.fleet_supervisor import FleetSupervisor
    from mpc_cover.service.controller.mission_clock import MissionClock
    from mpc_cover.service.controller.plan_publisher import PlanPublisher
    from mpc_cover.service.controller.step_log import StepLog

STOP_LEAD = 2.0
"""A stop begins so many state periods after the command: one for agents to read it, one for its computation."""
_SLICE_MIN = 0.01
"""Part of a period below which idle time is left alone; a plain choice: less than a descent takes."""
LATEST_START = 0.5
"""Part of the time for a step that must be left when it starts, or it is skipped."""


class ControlStep:
    """Runs the control law within its time budget, and has its plans published.

    Parameters
    ----------
    law, publisher : makes plans, and sends those that the safety filter admits.
    mission_clock, clock : `speed` is how many seconds of the clock pass in one of the machine's.
    control : periods and time limits.
    step_log : records the duration of each step.
    budget_of : makes a budget of so many seconds of the machine: of time, or of counted work.
    emit : publishes an event of a kind, with a text.

    Attributes
    ----------
    failures : steps in a row that raised, or whose plan was refused.
    sent : whether the last step sent a plan.
    """

    def __init__(
        self,
        law: ControlLaw,
        publisher: PlanPublisher,
        mission_clock: MissionClock,
        clock: Clock,
        control: Control,
        step_log: StepLog,
        *,
        speed: float,
        budget_of: Callable[[float], Budget],
        emit: Callable[[str, str], None],
    ) -> None:
        self.failures = 0
        self.sent = self._eased = False
        self._law, self._publisher, self._emit = law, publisher, emit
        self._mission_clock, self._clock, self._step_log = mission_clock, clock, step_log
        self._control, self._speed, self._budget_of = control, speed, budget_of
        self._lead_s = STOP_LEAD * control.state_period_s
        self._stop_sent_s: float | None = None
        self._idle_s = 0.0

    def set_law(self, law: ControlLaw, control: Control) -> None:
        """Plan by another law from now on, for another version of the mission."""
        self._law, self._control, self.failures, self._idle_s = law, control, 0, 0.0

    def prepare(self, state: FleetState, coverage: FlownMap) -> tuple[Proposal, float]:
        """Return the first plan of a fleet at rest, and its computing time [s]; exceptions of the law propagate."""
        begun = time.perf_counter()
        proposal = _checked(self._law.step(state, coverage, self._budget_of(self._control.planning_time_s)))
        return proposal, time.perf_counter() - begun

    def take_off(self, proposal: Proposal, state: FleetState, supervisor: FleetSupervisor, took_s: float) -> bool:
        """Start mission time, and send the first plan a period ahead of its start; return whether it was sent."""
        supervisor.monitor.freeze_clocks()
        self._mission_clock.start(self._clock.now() + self._control.period_s)
        self.sent = self._publish(proposal, state, supervisor)
        if not self.sent:
            self._mission_clock.pause()
        self._log(StepKind.PREPARE, state, proposal, took_s, took_s, missed=False)
        return self.sent

    def step(self, supervisor: FleetSupervisor, coverage: FlownMap) -> None:
        """Plan from the fleet's predicted state at the next tick, and send the plan; skip the step if it is too late.

        Raises
        ------
        UnknownPlanError
            An agent flies a plan that this controller did not send.
        """
        self.sent, self._idle_s = False, 0.0
        clock, tick = self._mission_clock, self._mission_clock.tick
        budget_s = self._control.deadline_fraction * self._control.period_s
        left_s = clock.grid(tick) + budget_s - self._clock.now()
        if left_s < LATEST_START * budget_s:
            self._step_log.skipped += 1
            return
        begun = time.perf_counter()
        state = supervisor.predict(clock.grid(tick + 1), clock.planned_start(tick + 1), clock.origin_s)
        budget = self._budget_of(left_s / self._speed)
        law_begun = time.perf_counter()
        try:
            proposal = _checked(self._law.step(state, coverage, budget))
        except Exception as error:  # noqa: BLE001 - agents fly on along their verified plans
            self.failures += 1
            self._emit("step-failed", f"a step failed: {error!r}; the previous plan goes on")
            return
        computing_s = time.perf_counter() - law_begun
        # what no clock shows where work is counted
        counted_s = clock.grid(tick) + budget_s - self._speed * budget.left_s
        if late := self._late(clock.grid(tick + 1), max(self._clock.now(), counted_s)):
            self._emit("late", "a step took too long: its plan is not sent, the previous one goes on")
        else:
            self.sent = self._publish(proposal, state, supervisor)
            self._idle_s = self._control.improvement_share * self._control.period_s if self.sent else 0.0
        took_s = time.perf_counter() - begun
        self._log(StepKind.STEP, state, proposal, computing_s, took_s, missed=late or budget.left_s < 0.0)

    def improve(self, limit_s: float) -> None:
        """Let the law use idle time, at most `limit_s` of the clock [s] and the mission's share of each period."""
        seconds = min(limit_s, self._idle_s)
        if seconds < _SLICE_MIN * self._control.period_s or not isinstance(self._law, ImprovesWhenIdle):
            return
        budget = self._budget_of(seconds / self._speed)
        try:
            more = self._law.improve(budget)
        except Exception as error:  # noqa: BLE001 - the plan that was sent is flown all the same
            self._emit("step-failed", f"an improvement failed: {error!r}; the plan goes on as it is")
            more = False
        self._idle_s = self._idle_s - (seconds - self._speed * budget.left_s) if more else 0.0

    def begin_stop(self) -> None:
        """Let the next `stop` send a motion to rest, whatever was sent before."""
        self._stop_sent_s = None

    def stop(self, supervisor: FleetSupervisor) -> None:
        """Send the earliest verified motion to rest; again where an agent reports not to have it.

        Braking begins as soon as agents can read of it. Where that is not safe, the fleet flies on along its plan to
        the next sample from which stopping is, at the latest to the plan's own end.

        Raises
        ------
        UnknownPlanError
            An agent flies a plan that this controller did not send.
        """
        if self._stop_sent_s is not None:
            heard_s = self._stop_sent_s + STOP_LEAD * self._control.state_period_s
            if not supervisor.without_plan(self._publisher.last_ref, heard_s):
                return
        clock = self._mission_clock
        soonest_s = self._clock.now() + self._lead_s
        for start_s, on_sample in ((soonest_s, False), (clock.next_sample(soonest_s), True)):
            state = supervisor.predict(start_s, start_s - clock.origin_s, clock.origin_s)
            motion = self._publisher.earliest_stop(state, on_sample=on_sample)
            if self._late(start_s, self._clock.now()):
                self._lead_s *= 2.0  # verifying takes longer than thought: the next attempt leaves it more time
            elif motion is not None and self._publish(Proposal(motion, PlanSource.BRAKE), state, supervisor):
                self._stop_sent_s = self._clock.now()
                return

    def _late(self, start_s: float, done_s: float) -> bool:
        """Return whether agents, which read their messages every `inbox_s`, may find a plan after its start.

        The plan is made at `done_s` of the controller's clock. Agents would reject it, not being in its start state by
        then, and all plans that assume that they fly it.
        """
        return done_s + self._control.inbox_s > start_s + SNAP_S

    def _publish(self, proposal: Proposal, state: FleetState, supervisor: FleetSupervisor) -> bool:
        """Send a proposal, if the safety filter admits it, and inform the law; return whether it was sent."""
        links, origin_s = supervisor.monitor.links, self._mission_clock.origin_s
        now_s, eased = self._clock.now(), proposal.eased
        verdict = self._publisher.publish(proposal.trajectory, state, links, origin_s, now_s, eased=eased)
        if not verdict.admitted:
            self.failures += 1
            self._emit("refused", f"the safety filter refuses a plan: {verdict.reason}; the previous plan goes on")
            return False
        self.failures = 0
        if eased and not self._eased:
            self._emit("eased", "the fleet is too tight to keep apart for long where messages are lost")
        self._eased = eased
        try:
            self._law.published(proposal.trajectory)
        except Exception as error:  # noqa: BLE001 - it was sent all the same
            self.failures += 1
            self._emit("step-failed", f"the control law failed on hearing what was sent: {error!r}")
        return True

    def _log(
        self, kind: StepKind, state: FleetState, proposal: Proposal, computing_s: float, took_s: float, *, missed: bool
    ) -> None:
        step = Step(kind, state.time, computing_s, took_s, proposal.source.name, proposal.reason, missed)
        self._step_log.add(step)


def _checked(proposal: Proposal) -> Proposal:
    """Return what a law proposes, if it is a proposal; its trajectory is for the safety filter to judge.

    Raises
    ------
    TypeError
        It is not: the step has failed.
    """
    if isinstance(proposal, Proposal) and isinstance(proposal.source, PlanSource) and isinstance(proposal.reason, str):
        return proposal
    raise TypeError(f"the control law returned {proposal!r:.80}, must be a Proposal")
