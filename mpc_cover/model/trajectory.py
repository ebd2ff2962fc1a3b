"""Sampled motion under a zero-order hold: one class for plans, initial guesses, moving obstacles and recordings.

The wire message (`service.protocol.messages.PlanMessage`) and the verifier's path (`verification.path.Path`) are
separate classes on purpose: the parser of untrusted bytes and the independent verifier share no code with this one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.model.motion import roll_out

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray

SNAP_S = 1e-8
"""Instants closer than this are the same [s]: a monotonic clock that has run for years resolves no more."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A motion of double integrators (3.1), exact between its samples; after its end it rests in its last position.

    Of a fleet, (N+1, m, d), or of one agent, (N+1, d): ``...`` below stands for m or for nothing.

    Attributes
    ----------
    time : (N+1,) [s], strictly increasing, on any clock; N >= 0.
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
        """Return a motion sampled uniformly every `period` [s] from `start_time` [s]; arrays as above."""
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
        """Return the step in progress at and right after given times [s]: -1 before the start, N after the end."""
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

    def subdivided(self, parts: int) -> Trajectory:
        """Return the same evenly sampled motion with `parts` samples a step: the input is held over all of them."""
        if parts == 1:
            return self.plain()
        later = np.repeat(self.velocity[:-1], parts, axis=0)
        part = np.tile(np.arange(1, parts + 1) / parts, self.steps).reshape(-1, *[1] * (self.velocity.ndim - 1))
        later = (1.0 - part) * later + part * np.repeat(self.velocity[1:], parts, axis=0)
        state = self.position[0], self.velocity[0]
        return Trajectory.from_velocities(*state, later, self.start_time, self.period / parts)

    def shift(self, seconds: float) -> Trajectory:
        """Return the same motion delayed by so many seconds, or on a clock that is ahead by as many."""
        return replace(self.plain(), time=self.time + seconds)

    def plain(self) -> Trajectory:
        """Return the motion without the additional fields of a recording."""
        return Trajectory(self.time, self.position, self.velocity, self.input, self.period)

    def remainder(self, time_s: float, position: FloatArray, velocity: FloatArray) -> Trajectory:
        """Return the shifted plan of receding-horizon control, from a sample's time [s] and the (..., d) state there.

        It keeps the planned velocities, has as many steps as before, padded at rest, and ends at rest. A `position` [m]
        that differs from the planned one translates the rest of the path.
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
