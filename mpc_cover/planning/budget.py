"""Deadlines on `time.perf_counter`, or on work done; None is no deadline.

Runs with a deadline on the clock differ from one to the next; those without, or with one on work, are the same
every time.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Self


@dataclass
class Meter:
    """Counts work in the seconds that it takes on the machine it was measured on: `spent_s`."""

    spent_s: float = 0.0


class Effort(float):
    """A deadline that has passed once a meter stands at `limit_s`; to a clock it never does."""

    meter: Meter
    limit_s: float

    def __new__(cls, meter: Meter, limit_s: float) -> Self:
        """Return the deadline; as a number it is infinite."""
        self = super().__new__(cls, math.inf)
        self.meter, self.limit_s = meter, limit_s
        return self


def late(deadline: float | None) -> bool:
    """Return whether a deadline has passed."""
    if isinstance(deadline, Effort):
        return deadline.meter.spent_s >= deadline.limit_s
    return deadline is not None and time.perf_counter() >= deadline


def part_of(deadline: float | None, part: float) -> float | None:
    """Return the deadline by which only a part of the time that is left has passed."""
    if deadline is None:
        return None
    if isinstance(deadline, Effort):
        spent_s = deadline.meter.spent_s
        return Effort(deadline.meter, spent_s + part * max(deadline.limit_s - spent_s, 0.0))
    now = time.perf_counter()
    return now + part * max(deadline - now, 0.0)
