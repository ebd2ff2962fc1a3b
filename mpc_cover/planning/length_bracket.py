"""Which length a free-horizon search tries next: bisection between lengths, one of which may be assumed only.

Refined plans are seldom much shorter than the best initial guess, so the search starts from a part of its length below
which nothing is expected. Guesses that suit their fleet badly (long periods, weak inputs) are far longer than
necessary: where no length failed, the search goes on downward, in strides that double.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

_INCREASE_MIN, _INCREASE_MAX, _INCREASE_STEPS = 0.06, 0.3, 2
"""Bounds on the relative increase of the length after a failure, whose size is the uncovered part of the cells, and
the least increase in steps. Plain choices."""
_STRIDE_MAX = 0.25
"""Bound on strides as a part of the length; a plain choice: lengths that fail take longest."""


@dataclass(frozen=True)
class LengthBracket:
    """Lengths in steps between which the shortest sufficient one is sought.

    Attributes
    ----------
    assumed : longest length that is expected to be insufficient, without having been tried.
    least : the fewest steps that a plan may have.
    shortest : shortest length that was sufficient; None before the first.
    failed : longest length shorter than that that was tried in vain; 0 for none.
    stride : steps by which the next length below `assumed` is shorter.
    """

    assumed: int
    least: int
    shortest: int | None = None
    failed: int = 0
    stride: int = 1

    def after(self, steps: int, *, complete: bool) -> LengthBracket:
        """Return the bracket after a length was tried."""
        if not complete:
            return replace(self, failed=max(self.failed, steps))
        below = steps <= self.assumed
        stride = min(2 * self.stride, max(1, round(_STRIDE_MAX * steps))) if below else self.stride
        return replace(self, shortest=steps, assumed=steps if below else self.assumed, stride=stride)

    def following(self, steps: int, left: float) -> int | None:
        """Return the length to try after `steps` left a part `left` of the demand; None if there is none."""
        if self.shortest is None:
            increase = min(max(left, _INCREASE_MIN), _INCREASE_MAX)
            return steps + max(_INCREASE_STEPS, round(increase * steps))
        if self.failed == 0 and self.assumed >= self.shortest - 1:
            tried = self.shortest - self.stride
        else:
            low = self.failed if self.assumed >= self.shortest else max(self.failed, self.assumed)
            tried = (low + self.shortest) // 2
        tried = max(tried, self.least)
        return tried if self.failed < tried < self.shortest else None
