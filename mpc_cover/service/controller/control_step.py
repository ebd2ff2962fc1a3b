"""One control step: predicted state, control law, safety filter, publication, within its budget of time.

A law that fails, comes too late, or proposes what the filter refuses leaves the previous plan in force.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from mpc_cover.model.trajectory import SNAP_S
from mpc_cover.service.controller.step_log import Step

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.clock import Clock
    from mpc_cover.control.control_law import ControlLaw, Proposal
    from mpc_cover.information.demand import FlownMap
    from mpc_cover.mission.config import Control
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.planning.budget import Budget
    from mpc_cover.service.controller.fleet_supervisor import FleetSupervisor
    from mpc_cover.service.controller.mission_clock import MissionClock
    from mpc_cover.service.controller.plan_publisher import PlanPublisher
    from mpc_cover.service.controller.step_log import StepLog

LATEST_START = 0.5
"""Part of the time for a step that must be left when it starts, or it is skipped."""


class ControlStep:
    """Asks the control law for plans, in time, and has them published.

    Parameters
    ----------
    law, publisher : who plans, and who sends what the safety filter admits.
    mission_clock, clock : when; `speed` is how many seconds of the clock pass in one of the machine's.
    control : periods and limits of time.
    steps : told what each step took.
    budget_of : makes a budget of so many seconds of the machine: of time, or of counted work.
    tell : told events, of a kind, in words.

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
        steps: StepLog,
        *,
        speed: float,
        budget_of: Callable[[float], Budget],
        tell: Callable[[str, str], None],
    ) -> None:
        self.failures = 0
        self.sent = False
        self._law, self._publisher, self._tell = law, publisher, tell
        self._mission_clock, self._clock, self._steps = mission_clock, clock, steps
        self._control, self._speed, self._budget_of = control, speed, budget_of

    def take_up(self, law: ControlLaw, control: Control) -> None:
        """Plan by another law from now on, for another version of the mission."""
        self._law, self._control, self.failures = law, control, 0

    def prepare(self, state: FleetState, coverage: FlownMap) -> tuple[Proposal, float]:
        """Return the first plan of a fleet at rest, and what it took [s]; whatever the law raises goes through."""
        begun = time.perf_counter()
        proposal = self._law.step(state, coverage, self._budget_of(self._control.planning_time_s))
        return proposal, time.perf_counter() - begun

    def take_off(self, proposal: Proposal, state: FleetState, supervisor: FleetSupervisor, took_s: float) -> bool:
        """Pin mission time to the clock, and send the first plan a period ahead of its start; return whether it is."""
        supervisor.fleet.freeze_clocks()
        self._mission_clock.start(self._clock.now() + self._control.period_s)
        self.sent = self._publish(proposal, state, supervisor)
        if not self.sent:
            self._mission_clock.pause()
        self._note("prepare", state, proposal, took_s, took_s, missed=False)
        return self.sent

    def step(self, supervisor: FleetSupervisor, coverage: FlownMap) -> None:
        """Plan from where everyone will be at the next tick, and send it; too late for that, skip it.

        Raises
        ------
        UnknownPlanError
            Someone flies a plan that this controller did not send.
        """
        self.sent = False
        clock, tick = self._mission_clock, self._mission_clock.tick
        budget_s = self._control.deadline_fraction * self._control.period_s
        left_s = clock.grid(tick) + budget_s - self._clock.now()
        if left_s < LATEST_START * budget_s:
            self._steps.skipped += 1
            return
        begun = time.perf_counter()
        state = supervisor.predicted(clock.grid(tick + 1), clock.planned_start(tick + 1), clock.origin_s)
        budget = self._budget_of(left_s / self._speed)
        thinking = time.perf_counter()
        try:
            proposal = self._law.step(state, coverage, budget)
        except Exception as error:  # noqa: BLE001 - agents fly on along their verified plans
            self.failures += 1
            self._tell("step-failed", f"a step failed: {error!r}; the previous plan goes on")
            return
        thought_s = time.perf_counter() - thinking
        if late := self._late(tick):
            self._tell("late", "a step took too long: its plan is not sent, the previous one goes on")
        else:
            self.sent = self._publish(proposal, state, supervisor)
        took_s = time.perf_counter() - begun
        self._note("step", state, proposal, thought_s, took_s, missed=late or budget.left_s < 0.0)

    def _late(self, tick: int) -> bool:
        """Return whether agents, who look at their mail once a state period, would find a plan after its start.

        They would refuse it, being elsewhere by then, and all that was planned in the belief that they fly it.
        """
        found_s = self._clock.now() + self._control.state_period_s
        return found_s > self._mission_clock.grid(tick + 1) + SNAP_S

    def _publish(self, proposal: Proposal, state: FleetState, supervisor: FleetSupervisor) -> bool:
        """Send a proposal, if the safety filter admits it, and tell the law; return whether it was sent."""
        links, origin_s = supervisor.fleet.links, self._mission_clock.origin_s
        verdict = self._publisher.publish(proposal.trajectory, state, links, origin_s, self._clock.now())
        if not verdict.admitted:
            self.failures += 1
            self._tell("refused", f"the safety filter refuses a plan: {verdict.reason}; the previous plan goes on")
            return False
        self.failures = 0
        try:
            self._law.published(proposal.trajectory)
        except Exception as error:  # noqa: BLE001 - it was sent all the same
            self.failures += 1
            self._tell("step-failed", f"the control law failed on hearing what was sent: {error!r}")
        return True

    def _note(
        self, kind: str, state: FleetState, proposal: Proposal, thought_s: float, took_s: float, *, missed: bool
    ) -> None:
        self._steps.add(Step(kind, state.time, thought_s, took_s, proposal.source.name, proposal.reason, missed))
