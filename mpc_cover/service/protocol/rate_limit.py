"""How much one author may say: more costs whoever verifies it more time than it has."""

from __future__ import annotations

BURST = 1024
"""Messages at once: the history that a controller asks for after a crash is 600 states (`bus.STATE`)."""
PER_S = 200.0
"""Messages a second of the receiver's clock, for long: ten times the reports of an agent that reports at 20 Hz.
Verifying them takes 2 % of a core, measured."""


class RateLimit:
    """Counts the messages of each author against an allowance that grows with time, up to a burst."""

    def __init__(self, burst: float = BURST, per_s: float = PER_S) -> None:
        self._burst, self._per_s = burst, per_s
        self._left: dict[str, tuple[float, float]] = {}

    def allows(self, author: str, now_s: float) -> bool:
        """Return whether a message that comes at `now_s` [s] is within its author's allowance, and count it."""
        left, last_s = self._left.get(author, (self._burst, now_s))
        left = min(self._burst, left + self._per_s * max(0.0, now_s - last_s))
        allowed = left >= 1.0
        self._left[author] = left - allowed, now_s
        return allowed
