"""Results of a verification: what was checked, and by what margin it holds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Any


class CheckName(StrEnum):
    """The properties that are checked, by their names in reports."""

    NUMBERS = "numbers"
    DYNAMICS_POSITION = "dynamics of position"
    DYNAMICS_VELOCITY = "dynamics of velocity"
    POSITION_SUM = "residuals of position in sum"
    VELOCITY_SUM = "residuals of velocity in sum"
    SPEED = "speed"
    INPUT = "input"
    NO_INPUT = "no input"
    BOX = "box"
    SEPARATION = "separation"
    CONNECTIVITY = "connectivity"
    LOSSES = "evidence of losses"
    RECONNECTION = "together again after a loss"
    LINKS = "links kept"
    REST = "rest at the end"
    START_POSITION = "start position"
    START_VELOCITY = "start velocity"
    END_POSITION = "end position"
    CLOSED_POSITION = "closed in position"
    CLOSED_VELOCITY = "closed in velocity"
    CELLS = "cells of the mission"
    COVERAGE = "coverage"
    COVERAGE_CLAIMED = "coverage claimed"
    COVERAGE_KEPT = "coverage kept"
    AGE_LIMIT = "age limit"
    SEAL = "record as it was written"
    SOURCES = "records that it was made of"


@dataclass(frozen=True)
class Check:
    """One property of a motion.

    Attributes
    ----------
    name : the property that was checked: a `CheckName`, or the name of a constraint of a user.
    holds : whether it holds, within the verifier's tolerance.
    margin : the smallest slack; negative where the property is violated; -inf when it could not be checked.
    unit : of the margin.
    where : agent or pair, and time, of the smallest margin.
    """

    name: CheckName | str
    holds: bool
    margin: float
    unit: str
    where: str

    def __str__(self) -> str:
        word = "holds, slack" if self.holds else "FAILS, margin"
        margin = f"{self.margin:.3g} {self.unit}".rstrip()  # a user's constraint has no unit that we know
        return f"{self.name}: {word} {margin} ({self.where})"

    def to_dict(self) -> dict[str, Any]:
        """Return the check as plain data; a margin that is not finite becomes None, as JSON has no inf."""
        margin = self.margin if math.isfinite(self.margin) else None
        return {"name": self.name, "holds": self.holds, "margin": margin, "unit": self.unit, "where": self.where}


@dataclass(frozen=True)
class Report:
    """All checks of a motion."""

    checks: tuple[Check, ...]

    @property
    def holds(self) -> bool:
        """Whether everything holds; False for an empty report."""
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
