"""How an agent plays its plans: the inputs over time, and the exact motion that they give.

The controller predicts with the same code as the agents fly, so that both agree to the last bits.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray
    from mpc_cover.service.protocol.messages import PlanMessage, PlanRef, Samples

SNAP_S = 1e-8
"""Instants nearer than this are the same: a long-running monotonic clock has no more digits [s]."""
STANDSTILL = 1e-9
"""Slower than this is standing still [m/s]."""
START_TOLERANCE = 1e-3
"""Between where a plan starts and where the agent is then [m], [m/s]."""


@dataclass(frozen=True, eq=False)
class Flight:
    """A plan in the clock of the agent that flies it.

    Attributes
    ----------
    ref : which plan.
    start_s, period_s : [s].
    position, velocity : (N+1, d) [m], [m/s].
    input : (N, d) [m/s^2], held constant over each period.
    """

    ref: PlanRef
    start_s: float
    period_s: float
    position: FloatArray
    velocity: FloatArray
    input: FloatArray

    @property
    def steps(self) -> int:
        """Number of steps N."""
        return int(self.input.shape[0])

    @property
    def end_s(self) -> float:
        """When the plan ends, at rest [s]."""
        return self.start_s + self.steps * self.period_s

    def index(self, time_s: float) -> int:
        """Return the step that is flown from `time_s` on; N or more after the end."""
        return int(np.floor((time_s - self.start_s + SNAP_S) / self.period_s))

    def state_at(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        """Return the planned position and velocity (d,); the first before the start, the last after the end."""
        index = self.index(time_s)
        if index < 0 or index >= self.steps:
            edge = 0 if index < 0 else -1
            return self.position[edge], self.velocity[edge]
        dt = time_s - (self.start_s + index * self.period_s)
        force, velocity = self.input[index], self.velocity[index]
        return self.position[index] + dt * velocity + 0.5 * dt**2 * force, velocity + dt * force


def flight_of(message: PlanMessage) -> Flight:
    """Return the plan in a message as arrays."""
    return Flight(
        message.ref,
        message.start_s,
        message.period_s,
        _array(message.position),
        _array(message.velocity),
        _array(message.input),
    )


def _array(samples: Samples) -> FloatArray:
    return np.array(samples, dtype=float)


@dataclass
class Schedule:
    """The plan being flown and those that wait for their start, in the order of their starts.

    After the last one the agent brakes, should it still move, and stays where it is.
    """

    input_max: float
    flown: Flight | None = None
    queue: tuple[Flight, ...] = ()

    def add(self, flight: Flight) -> None:
        """Queue a newer plan; it takes the place of all that would start later."""
        self.queue = (*(q for q in self.queue if q.start_s < flight.start_s - SNAP_S), flight)

    def switch(self, time_s: float) -> None:
        """Take up the newest plan whose start has come."""
        while self.queue and self.queue[0].start_s <= time_s + SNAP_S:
            self.flown, self.queue = self.queue[0], self.queue[1:]

    def flying(self, time_s: float) -> Flight | None:
        """Return the plan that still has inputs to play."""
        return self.flown if self.flown is not None and self.flown.index(time_s) < self.flown.steps else None

    def hold(self, time_s: float, velocity: FloatArray) -> tuple[FloatArray, float]:
        """Return the input (d,) [m/s^2] to hold from `time_s` on, and until when [s]."""
        limit = self.queue[0].start_s if self.queue else np.inf
        if flight := self.flying(time_s):
            index = flight.index(time_s)
            return flight.input[index], min(flight.start_s + (index + 1) * flight.period_s, limit)
        speed = float(np.linalg.norm(velocity))
        if speed > STANDSTILL:
            return -self.input_max / speed * velocity, min(time_s + speed / self.input_max, limit)
        return np.zeros_like(velocity), limit

    def rests(self, time_s: float, velocity: FloatArray) -> bool:
        """Return whether it stands still and no plan has an input left that would move it."""
        if float(np.linalg.norm(velocity)) > STANDSTILL:
            return False
        flight = self.flying(time_s)
        left = [flight.input[max(0, flight.index(time_s)) :]] if flight else []
        return not any(np.any(np.abs(force) > STANDSTILL) for force in (*left, *(q.input for q in self.queue)))


@dataclass
class Plant:
    """A double integrator at an instant (3.1, 3.2), moved exactly from input to input.

    `position`, `velocity` are (d,) [m], [m/s]. `log` is told each piece of the motion: its start, the state
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
            self._take_up(schedule.flown)
            flight = schedule.flying(self.time_s)
            if flight is None and float(np.linalg.norm(self.velocity)) <= STANDSTILL:
                self.velocity = np.zeros_like(self.velocity)
            if self.time_s >= until_s:
                return
            force, end_s = schedule.hold(self.time_s, self.velocity)
            self._move(min(end_s, until_s), force, flight)

    def _take_up(self, flight: Flight | None) -> None:
        """Go on from where it is: whoever flies a plan exactly has no choice."""

    def _move(self, end_s: float, force: FloatArray, flight: Flight | None) -> None:
        if self.log is not None:
            self.log(self.time_s, self.position, self.velocity, force, flight.ref if flight else None)
        dt = end_s - self.time_s
        self.position = self.position + dt * self.velocity + 0.5 * dt**2 * force
        self.velocity = self.velocity + dt * force
        self.time_s = end_s


@dataclass
class Reference(Plant):
    """The motion that a disturbed agent tracks: that of its plans, taken up where they say, not where it is.

    `flown` is the plan taken up last.
    """

    flown: Flight | None = None

    def _take_up(self, flight: Flight | None) -> None:
        if flight is None or flight is self.flown:
            return
        self.flown = flight
        position, velocity = flight.state_at(self.time_s)
        away = max(np.abs(position - self.position).max(), np.abs(velocity - self.velocity).max())
        if away > START_TOLERANCE:
            self.position, self.velocity = position.copy(), velocity.copy()


def predict(plant: Plant, schedule: Schedule, time_s: float) -> tuple[FloatArray, FloatArray]:
    """Return position and velocity (d,) at a later `time_s`, leaving plant and schedule as they are."""
    ahead = replace(plant, log=None)
    ahead.advance(time_s, replace(schedule))
    return ahead.position, ahead.velocity
