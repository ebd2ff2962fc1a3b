"""The sampled motion under a zero-order hold: one class for plans, guesses, obstacles and records alike.

The wire message (`service.protocol.messages.PlanMessage`) and the verifier's path (`verification.path.Path`) stay
apart on purpose: bytes from outside and the judge of what is inside share no code with what they look at.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.model.motion import roll_out

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray

SNAP_S = 1e-8
"""Instants nearer than this are the same: a long-running monotonic clock has no more digits [s]."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A motion of double integrators (3.1), exact between its samples; at rest in its last state after its end.

    Of a fleet (N+1, m, d), or of one agent (N+1, d): what is said of ``...`` below is m, or nothing.

    Attributes
    ----------
    time : (N+1,) [s], strictly increasing, of whatever clock; N >= 0.
    position, velocity : (N+1, ..., d) [m], [m/s].
    input : (N, ..., d) [m/s^2], held constant from each sample to the next.
    period : T_s [s] where samples are evenly spaced; NaN where they are not.
    """

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    input: FloatArray
    period: float = float("nan")

    @classmethod
    def even(
        cls, start_time: float, period: float, position: FloatArray, velocity: FloatArray, force: FloatArray
    ) -> Trajectory:
        """Return the motion with samples every `period` [s] from `start_time` [s] on; arrays as above."""
        time = start_time + period * np.arange(velocity.shape[0], dtype=float)
        return Trajectory(time, position, velocity, force, period)

    @classmethod
    def from_velocities(
        cls, position: FloatArray, velocity: FloatArray, later: FloatArray, start_time: float, period: float
    ) -> Trajectory:
        """Return the motion from a (..., d) state with velocities `later` (N, ..., d) [m/s] at samples 1 to N."""
        velocities = np.concatenate([velocity[None], later])
        force = np.diff(velocities, axis=0) / period
        positions, _ = roll_out(position, velocity, force, period)
        return cls.even(start_time, period, positions, velocities, force)

    @classmethod
    def at_rest(cls, position: FloatArray, start_time: float, period: float, steps: int) -> Trajectory:
        """Return the motion that stays at a (..., d) position [m]."""
        held = np.repeat(position[None], steps + 1, axis=0)
        return cls.even(start_time, period, held, np.zeros_like(held), np.zeros_like(held[1:]))

    @property
    def steps(self) -> int:
        """Number of steps N."""
        return int(self.input.shape[0])

    @property
    def start_time(self) -> float:
        """Time of sample 0 [s]."""
        return float(self.time[0])

    @property
    def end_time(self) -> float:
        """Time of the last sample [s]; at rest from then on."""
        return float(self.time[-1])

    def index(self, time_s: float | FloatArray, snap_s: float = SNAP_S) -> Any:
        """Return the step that is flown at and right after given times: -1 before the start, N after the end."""
        return np.searchsorted(self.time, np.asarray(time_s) + snap_s, side="right") - 1

    def at(self, time_s: float | FloatArray, snap_s: float = SNAP_S) -> tuple[FloatArray, FloatArray]:
        """Return positions [m] and velocities [m/s], (..., d), at a time; at times (Q,), (Q, ..., d)."""
        row, elapsed, force = self._held(time_s, snap_s)
        velocity = self.velocity[row]
        return self.position[row] + elapsed * velocity + 0.5 * elapsed**2 * force, velocity + elapsed * force

    def input_at(self, time_s: float | FloatArray, snap_s: float = SNAP_S) -> FloatArray:
        """Return the inputs [m/s^2] held at and right after given times, zero outside; shapes as `at`."""
        return self._held(time_s, snap_s)[2]

    def agent(self, index: int) -> Trajectory:
        """Return one agent's motion."""
        return replace(
            self.plain(), position=self.position[:, index], velocity=self.velocity[:, index], input=self.input[:, index]
        )

    def slice(self, first: int, last: int) -> Trajectory:
        """Return the motion from sample `first` to sample `last`, both included."""
        samples = slice(first, last + 1)
        return Trajectory(
            self.time[samples],
            self.position[samples],
            self.velocity[samples],
            self.input[first:last],
            self.period,
        )

    def shift(self, seconds: float) -> Trajectory:
        """Return the same motion so much later, or by a clock that is so much ahead."""
        return replace(self.plain(), time=self.time + seconds)

    def plain(self) -> Trajectory:
        """Return the motion alone, without what a recording knows beside it."""
        return Trajectory(self.time, self.position, self.velocity, self.input, self.period)

    def remainder(self, time_s: float, position: FloatArray, velocity: FloatArray) -> Trajectory:
        """Return what is left from a sample's time on, from the (..., d) state there, as long as before, to rest.

        The shifted plan of receding-horizon control: velocities are those planned, and a start that differs a little
        moves the rest of the path in parallel.
        """
        done = round((time_s - self.start_time) / self.period)
        left = self.velocity[min(max(done, 0), self.steps) :]
        padded = np.zeros_like(self.velocity)
        padded[: left.shape[0]] = left
        padded[-1] = 0.0
        return Trajectory.from_velocities(position, velocity, padded[1:], time_s, self.period)

    def _held(self, time_s: float | FloatArray, snap_s: float) -> tuple[Any, FloatArray, FloatArray]:
        """Return for given times the sample before, the time since [s] and the input held, ready to be broadcast."""
        instant = np.asarray(time_s, dtype=float)
        step = self.index(instant, snap_s)
        inside = (step >= 0) & (step < self.steps)
        row = np.clip(step, 0, self.steps)
        more = (1,) * (self.position.ndim - 1)
        elapsed = np.where(inside, instant - self.time[row], 0.0).reshape(*instant.shape, *more)
        if self.steps == 0:
            return row, elapsed, np.zeros_like(self.position[row])
        force = self.input[np.minimum(row, self.steps - 1)]
        return row, elapsed, np.where(inside.reshape(*instant.shape, *more), force, 0.0)
