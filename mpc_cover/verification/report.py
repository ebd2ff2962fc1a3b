"""What was verified, and by what margin it holds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Check:
    """One property of a motion.

    Attributes
    ----------
    name : what was looked at.
    holds : whether it is so, within the verifier's tolerance.
    margin : the slack left where it is smallest; negative is by how much it is violated; -inf when it
        could not be looked at.
    unit : of the margin.
    where : agent or pair, and time, of the smallest margin.
    """

    name: str
    holds: bool
    margin: float
    unit: str
    where: str

    def __str__(self) -> str:
        word = "holds, slack" if self.holds else "FAILS, margin"
        return f"{self.name}: {word} {self.margin:.3g} {self.unit} ({self.where})"

    def to_dict(self) -> dict[str, Any]:
        """Return the check as plain data; a margin that is not finite becomes None, as JSON has no inf."""
        margin = self.margin if math.isfinite(self.margin) else None
        return {"name": self.name, "holds": self.holds, "margin": margin, "unit": self.unit, "where": self.where}


@dataclass(frozen=True)
class Report:
    """All that was verified about a motion."""

    checks: tuple[Check, ...]

    @property
    def holds(self) -> bool:
        """Whether everything holds; an empty report vouches for nothing."""
        return bool(self.checks) and all(check.holds for check in self.checks)

    @property
    def failures(self) -> tuple[Check, ...]:
        """The checks that do not hold, in order."""
        return tuple(check for check in self.checks if not check.holds)

    @property
    def first_failure(self) -> Check | None:
        """The first check that does not hold, or None."""
        return next((check for check in self.checks if not check.holds), None)

    def to_dict(self) -> dict[str, Any]:
        """Return the report as plain data for `--json`."""
        return {"holds": self.holds, "checks": [check.to_dict() for check in self.checks]}
