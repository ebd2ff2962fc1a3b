"""What a decision may take: seconds of the wall clock, or the same seconds of counted work.

Daemons plan by the wall clock. Simulations count work instead, in the seconds that it takes on the machine it was
measured on, so that they are the same every time; whoever plans cannot tell the difference, and decides alike.
"""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Protocol

from mpc_cover.planning.metered_backend import metered

if TYPE_CHECKING:
    from collections.abc import Callable

    from solvers.backends.base import Backend


FLIGHT_S = 1.5e-4
"""Seconds that flying a guess takes, a sample: waypoints tracked, its cost and bounds evaluated (box-3, one core)."""


class _Clock(Protocol):
    counts: bool

    def now(self) -> float: ...

    def charge(self, work_s: float) -> None: ...


class _WallClock:
    """Time passes by itself."""

    counts = False
    now = staticmethod(time.perf_counter)

    def charge(self, work_s: float) -> None:
        """Do nothing."""


class _WorkCounter:
    """Time passes by work."""

    counts = True

    def __init__(self) -> None:
        self._spent_s = 0.0

    def now(self) -> float:
        return self._spent_s

    def charge(self, work_s: float) -> None:
        self._spent_s += work_s


class Budget:
    """A deadline on a clock that may count work instead of time; parts of a budget share its clock."""

    def __init__(self, clock: _Clock, deadline: float) -> None:
        self._clock, self._deadline = clock, deadline

    @classmethod
    def wall_clock(cls, seconds: float) -> Budget:
        """Return a budget of time from now on [s]."""
        return cls.until(time.perf_counter() + seconds)

    @classmethod
    def until(cls, deadline: float) -> Budget:
        """Return a budget of time up to an instant of `time.perf_counter` [s]."""
        return cls(_WallClock(), deadline)

    @classmethod
    def counted(cls, seconds: float) -> Budget:
        """Return a budget of counted work [s]: what is done with it is the same every time."""
        return cls(_WorkCounter(), seconds)

    @classmethod
    def unlimited(cls) -> Budget:
        """Return a budget that is never exhausted: other bounds end the work."""
        return cls(_WallClock(), math.inf)

    @property
    def left_s(self) -> float:
        """What is left [s]; negative when more was spent than there was."""
        return self._deadline - self._clock.now()

    @property
    def exhausted(self) -> bool:
        """Whether nothing is left."""
        return self.left_s <= 0.0

    @property
    def clock(self) -> Callable[[], float]:
        """The clock that `deadline` is on [s]."""
        return self._clock.now

    @property
    def deadline(self) -> float | None:
        """When it is exhausted, on `clock` [s]; None for never."""
        return None if math.isinf(self._deadline) else self._deadline

    def part(self, share: float) -> Budget:
        """Return a budget of a share of what is left."""
        left = self.left_s
        return self if math.isinf(left) else Budget(self._clock, self._clock.now() + share * max(left, 0.0))

    def extended(self, seconds: float) -> Budget:
        """Return the budget with so much more [s]."""
        return Budget(self._clock, self._deadline + seconds)

    def charge(self, work_s: float) -> None:
        """Count work done outside of a back-end, in the seconds that it takes; time passes by itself."""
        self._clock.charge(work_s)

    def metered(self, backend: Backend) -> Backend:
        """Return the back-end, whose QPs are charged to this budget where work is counted."""
        return metered(backend, self._clock.charge) if self._clock.counts else backend
