"""Time budgets: seconds of the wall clock, or the equivalent seconds of counted work.

Daemons plan by the wall clock. Simulations count work instead, in the seconds that it takes on the machine on which it
was measured, so that they are deterministic. The planner's code is the same for both.
"""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Protocol

from mpc_cover.planning.metered_backend import metered

if TYPE_CHECKING:
    from collections.abc import Callable

    from solvers.backends.base import Backend


GUESS_SAMPLE_S = 1.5e-4
"""Seconds that an initial guess takes per sample: waypoint tracking, evaluation of cost and bounds. Measured on box-3,
one core."""


class _Clock(Protocol):
    counts: bool

    def now(self) -> float: ...

    def charge(self, work_s: float) -> None: ...


class _WallClock:
    """The wall clock."""

    counts = False
    now = staticmethod(time.perf_counter)

    def charge(self, work_s: float) -> None:
        """Do nothing: the clock runs by itself."""


class _WorkCounter:
    """A clock that advances by the work charged to it."""

    counts = True

    def __init__(self) -> None:
        self._spent_s = 0.0

    def now(self) -> float:
        return self._spent_s

    def charge(self, work_s: float) -> None:
        self._spent_s += work_s


class Budget:
    """A deadline on a clock, which may count work instead of time; parts of a budget share its clock."""

    def __init__(self, clock: _Clock, deadline: float) -> None:
        self._clock, self._deadline = clock, deadline

    @classmethod
    def wall_clock(cls, seconds: float) -> Budget:
        """Return a budget of wall-clock time from now on [s]."""
        return cls.until(time.perf_counter() + seconds)

    @classmethod
    def until(cls, deadline: float) -> Budget:
        """Return a budget of wall-clock time up to an instant of `time.perf_counter` [s]."""
        return cls(_WallClock(), deadline)

    @classmethod
    def counted(cls, seconds: float) -> Budget:
        """Return a budget of counted work [s]: what is done within it is deterministic."""
        return cls(_WorkCounter(), seconds)

    @classmethod
    def unlimited(cls) -> Budget:
        """Return a budget that is never exhausted; the effort must be bounded otherwise."""
        return cls(_WallClock(), math.inf)

    @property
    def counts(self) -> bool:
        """Whether work is counted instead of time."""
        return self._clock.counts

    @property
    def left_s(self) -> float:
        """Time left [s]; negative once the deadline is exceeded."""
        return self._deadline - self._clock.now()

    @property
    def exhausted(self) -> bool:
        """Whether nothing is left."""
        return self.left_s <= 0.0

    @property
    def clock(self) -> Callable[[], float]:
        """The clock of `deadline` [s]."""
        return self._clock.now

    @property
    def deadline(self) -> float | None:
        """The deadline on `clock` [s]; None for none."""
        return None if math.isinf(self._deadline) else self._deadline

    def part(self, share: float) -> Budget:
        """Return a budget of a share of the time left."""
        left = self.left_s
        return self if math.isinf(left) else Budget(self._clock, self._clock.now() + share * max(left, 0.0))

    def extended(self, seconds: float) -> Budget:
        """Return a budget whose deadline is later by so many seconds."""
        return Budget(self._clock, self._deadline + seconds)

    def charge(self, work_s: float) -> None:
        """Charge work done outside a back-end, in the seconds that it takes; without effect on the wall clock."""
        self._clock.charge(work_s)

    def metered(self, backend: Backend) -> Backend:
        """Return the back-end; where work is counted, its QPs are charged to this budget."""
        return metered(backend, self._clock.charge) if self._clock.counts else backend
