"""The schedule of an agent's plans: the inputs over time, and the exact motion that they give.

The controller predicts with the same code that agents fly by, so that both agree to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.trajectory import SNAP_S, Trajectory

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray
    from mpc_cover.service.protocol.messages import PlanMessage, PlanRef

STANDSTILL = 1e-9
"""Speed below which an agent counts as at rest [m/s]."""


@dataclass(frozen=True, eq=False)
class ScheduledPlan:
    """A plan of one agent, in the clock of that agent, with the id by which it is reported."""

    ref: PlanRef
    motion: Trajectory


def plan_in(message: PlanMessage) -> ScheduledPlan:
    """Return the plan in a message as arrays."""
    arrays = (np.array(samples, dtype=float) for samples in (message.position, message.velocity, message.input))
    return ScheduledPlan(message.ref, Trajectory.even(message.start_s, message.period_s, *arrays))


@dataclass
class Schedule:
    """The plan being flown and those queued for their start, in the order of their starts.

    After the last one the agent brakes if it still moves, and stays where it is.
    """

    input_max: float
    flown: ScheduledPlan | None = None
    queue: tuple[ScheduledPlan, ...] = ()

    def add(self, plan: ScheduledPlan) -> None:
        """Queue a newer plan; it replaces all that would start later."""
        self.queue = (*(q for q in self.queue if q.motion.start_time < plan.motion.start_time - SNAP_S), plan)

    def switch(self, time_s: float) -> None:
        """Switch to the newest plan whose start time has come."""
        while self.queue and self.queue[0].motion.start_time <= time_s + SNAP_S:
            self.flown, self.queue = self.queue[0], self.queue[1:]

    def flying(self, time_s: float) -> ScheduledPlan | None:
        """Return the plan that still has inputs to apply."""
        flown = self.flown
        return flown if flown is not None and flown.motion.index(time_s) < flown.motion.steps else None

    def hold(self, time_s: float, velocity: FloatArray) -> tuple[FloatArray, float]:
        """Return the input (d,) [m/s^2] to hold from `time_s` on, and until when [s]."""
        limit = self.queue[0].motion.start_time if self.queue else np.inf
        if plan := self.flying(time_s):
            index = plan.motion.index(time_s)
            return plan.motion.input[index], min(float(plan.motion.time[index + 1]), limit)
        speed = float(np.linalg.norm(velocity))
        if speed > STANDSTILL:
            return -self.input_max / speed * velocity, min(time_s + speed / self.input_max, limit)
        return np.zeros_like(velocity), limit

    def rests(self, time_s: float, velocity: FloatArray) -> bool:
        """Return whether it stands still and no plan has an input left that would move it."""
        if float(np.linalg.norm(velocity)) > STANDSTILL:
            return False
        plan = self.flying(time_s)
        left = [plan.motion.input[max(0, plan.motion.index(time_s)) :]] if plan else []
        return not any(np.any(np.abs(force) > STANDSTILL) for force in (*left, *(q.motion.input for q in self.queue)))


@dataclass
class Plant:
    """A double integrator at an instant (3.1, 3.2), integrated exactly from input to input.

    `position`, `velocity` are (d,) [m], [m/s]. `log` is called with each piece of the motion: its start, the state
    there, the input that is held until the next piece, and the plan flown.
    """

    time_s: float
    position: FloatArray
    velocity: FloatArray
    log: Callable[[float, FloatArray, FloatArray, FloatArray, PlanRef | None], None] | None = field(
        default=None, repr=False
    )

    def advance(self, until_s: float, schedule: Schedule) -> None:
        """Move to `until_s`, switching plans exactly at their starts."""
        while True:
            schedule.switch(self.time_s)
            self._switch_to(schedule.flown)
            plan = schedule.flying(self.time_s)
            if plan is None and float(np.linalg.norm(self.velocity)) <= STANDSTILL:
                self.velocity = np.zeros_like(self.velocity)
            if self.time_s >= until_s:
                return
            force, end_s = schedule.hold(self.time_s, self.velocity)
            self._move(min(end_s, until_s), force, plan)

    def _switch_to(self, plan: ScheduledPlan | None) -> None:
        """Do nothing: the plant continues from its own state."""

    def _move(self, end_s: float, force: FloatArray, plan: ScheduledPlan | None) -> None:
        if self.log is not None:
            self.log(self.time_s, self.position, self.velocity, force, plan.ref if plan else None)
        dt = end_s - self.time_s
        self.position = self.position + dt * self.velocity + 0.5 * dt**2 * force
        self.velocity = self.velocity + dt * force
        self.time_s = end_s


@dataclass
class Reference(Plant):
    """The reference motion that a disturbed agent tracks: each plan from its own start, not from the agent's state.

    `flown` is the last plan that it switched to; starts that differ by less than `start_tolerance` [m], [m/s] are the
    same.
    """

    flown: ScheduledPlan | None = None
    start_tolerance: float = 0.0

    def _switch_to(self, plan: ScheduledPlan | None) -> None:
        if plan is None or plan is self.flown:
            return
        self.flown = plan
        position, velocity = plan.motion.at(self.time_s)
        away = max(np.abs(position - self.position).max(), np.abs(velocity - self.velocity).max())
        if away > self.start_tolerance:
            self.position, self.velocity = position.copy(), velocity.copy()


def predict(plant: Plant, schedule: Schedule, time_s: float) -> tuple[FloatArray, FloatArray]:
    """Return position and velocity (d,) at a later `time_s`, leaving plant and schedule as they are."""
    ahead = replace(plant, log=None)
    ahead.advance(time_s, replace(schedule))
    return ahead.position, ahead.velocity
