"""Deadlines on `time.perf_counter`; None is no deadline, and runs without one are the same every time."""

from __future__ import annotations

import time


def late(deadline: float | None) -> bool:
    """Return whether a deadline has passed."""
    return deadline is not None and time.perf_counter() >= deadline


def part_of(deadline: float | None, part: float) -> float | None:
    """Return the deadline by which only a part of the time that is left has passed."""
    if deadline is None:
        return None
    now = time.perf_counter()
    return now + part * max(deadline - now, 0.0)
