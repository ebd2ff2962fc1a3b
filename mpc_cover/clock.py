"""Clocks, which are passed in so that tests can replace them."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from threading import Event


class Clock(Protocol):
    """A monotonic clock in seconds; wall clocks are not used, as they may jump."""

    def now(self) -> float:
        """Return the time [s] since an arbitrary origin."""
        ...

    def wait_until(self, time_s: float, stop: Event) -> bool:
        """Wait until `time_s`; return False as soon as `stop` is set."""
        ...


class MonotonicClock:
    """The machine's monotonic clock, `speed` times as fast.

    On one machine all processes share its origin, so that recordings of several can be merged.
    """

    def __init__(self, speed: float = 1.0) -> None:
        self.speed = speed

    def now(self) -> float:
        """Return the scaled monotonic time [s]."""
        return time.monotonic() * self.speed

    def wait_until(self, time_s: float, stop: Event) -> bool:
        """Wait until `time_s` of this clock; return False as soon as `stop` is set."""
        while (left := time_s - self.now()) > 0.0:
            if stop.wait(left / self.speed):
                return False
        return not stop.is_set()


class VirtualClock:
    """A clock that moves only when waited on, for deterministic runs."""

    def __init__(self, time_s: float = 0.0) -> None:
        self._time_s = time_s

    def now(self) -> float:
        """Return the virtual time [s]."""
        return self._time_s

    def wait_until(self, time_s: float, stop: Event) -> bool:
        """Jump to `time_s`."""
        self._time_s = max(self._time_s, time_s)
        return not stop.is_set()
