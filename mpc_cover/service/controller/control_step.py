"""Asks the brain for plans, in time, and sends them; a brain that fails leaves the previous plan in force."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpc_cover.service.controller.step_log import Step

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray
    from mpc_cover.clock import Clock
    from mpc_cover.control.control_law import ControlLaw, StepOutcome
    from mpc_cover.mission.config import Control
    from mpc_cover.service.controller.fleet_supervisor import FleetSupervisor
    from mpc_cover.service.controller.mission_clock import MissionClock
    from mpc_cover.service.controller.plan_publisher import PlanPublisher
    from mpc_cover.service.controller.step_log import StepLog

LATEST_START = 0.5
"""Part of the time for a step that must be left when it starts, or it is skipped."""


@dataclass(frozen=True)
class Budget:
    """How long things may take: `speed` is how many seconds of the clock pass in one of the machine's.

    Without `deadlines` nothing has one, and runs are deterministic.
    """

    control: Control
    speed: float
    deadlines: bool


class ControlStep:
    """One mission's brain, with its budget of time; `sent` says whether the last step sent a plan.

    Parameters
    ----------
    brain, plan_publisher : who thinks, and who sends.
    timeline, clock : when.
    steps : told what each step took.
    budget : what it may take.
    tell : told events, of a kind, in words.
    """

    def __init__(
        self,
        law: ControlLaw,
        plan_publisher: PlanPublisher,
        mission_clock: MissionClock,
        clock: Clock,
        steps: StepLog,
        budget: Budget,
        tell: Callable[[str, str], None],
    ) -> None:
        self.failures = 0
        self.sent = False
        self._law, self._plan_publisher, self._tell = law, plan_publisher, tell
        self._mission_clock, self._clock, self._steps = mission_clock, clock, steps
        self._control, self._speed, self._deadlines = budget.control, budget.speed, budget.deadlines
        self._begun = 0.0

    def take_up(self, law: ControlLaw, control: Control) -> None:
        """Plan by another law from now on, for another version of the mission."""
        self._law, self._control, self.failures = law, control, 0

    def prepare(self, position: FloatArray, velocity: FloatArray) -> StepOutcome:
        """Return the first plan of a fleet at rest at (m, d) [m]; whatever the brain raises goes through."""
        self._begun = time.perf_counter()
        deadline = self._begun + self._control.planning_time_s if self._deadlines else None
        return self._law.prepare(position, velocity, self._mission_clock.now(), deadline=deadline)

    def take_off(self, result: StepOutcome, supervisor: FleetSupervisor) -> None:
        """Pin mission time to the clock, and send the first plan a period ahead of its start."""
        supervisor.fleet.freeze_clocks()
        self._mission_clock.start(self._clock.now() + self._control.period_s)
        self.failures = 0
        self._send(result, supervisor, "prepare")

    def step(self, supervisor: FleetSupervisor) -> None:
        """Plan from where everyone will be at the next tick, and send it; too late for that, skip it.

        Raises
        ------
        UnknownPlanError
            Someone flies a plan that this controller did not send.
        """
        self.sent = False
        now, tick = self._clock.now(), self._mission_clock.tick
        budget = self._control.deadline_fraction * self._control.period_s
        left = self._mission_clock.grid(tick) + budget - now
        if self._deadlines and left < LATEST_START * budget:
            self._steps.skipped += 1
            return
        self._begun = time.perf_counter()
        position, velocity = supervisor.ahead(self._mission_clock.grid(tick + 1))
        supervisor.warn(self._mission_clock.grid(tick + 1), self._mission_clock.origin_s)
        deadline = self._begun + left / self._speed if self._deadlines else None
        start = self._mission_clock.planned_start(tick + 1)
        try:
            result = self._law.step(position, velocity, start, deadline=deadline)
        except Exception as error:  # noqa: BLE001 - agents fly on along their verified plans
            self.failures += 1
            self._tell("step-failed", f"a step failed: {error!r}; the previous plan goes on")
            return
        self.failures = 0
        late = self._late(tick)
        self._send(result, supervisor, "step", late=late)
        self.sent = not late

    def _late(self, tick: int) -> bool:
        """Return whether agents, who look at their mail once a state period, would find a plan after its start.

        They would refuse it, being elsewhere by then, and all that was planned in the belief that they fly it.
        """
        return self._deadlines and self._clock.now() + self._control.state_period_s > self._mission_clock.grid(tick + 1)

    def _send(self, result: StepOutcome, supervisor: FleetSupervisor, kind: str, *, late: bool = False) -> None:
        origin_s, now = self._mission_clock.origin_s, self._clock.now()
        if late:
            self._tell("late", "a step took too long: its plan is not sent, the previous one goes on")
        else:
            self._plan_publisher.send(
                result.plan, supervisor.fleet.links, origin_s, now, without=supervisor.lost_indices
            )
        self._steps.add(
            Step(
                kind,
                result.plan.start_time,
                result.computing_time_s,
                time.perf_counter() - self._begun,
                result.plan_source.name,
                result.reason,
                result.deadline_missed or late,
            )
        )
