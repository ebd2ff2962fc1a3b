"""Options common to all back-ends."""

from __future__ import annotations

import math
from dataclasses import dataclass

from solvers.residuals import Tolerances

_ACCEPTANCE_FACTOR = 10.0
"""Residuals up to this multiple of the tolerance count as solved: solvers scale their own differently. Plain choice."""


@dataclass(frozen=True)
class Options:
    """Options common to all back-ends.

    Attributes
    ----------
    tolerance: eps_abs = eps_rel of the native solver.
    max_iterations: None for the default of the back-end's module.
    accept: residuals that count as solved; None for ten times `tolerance`, absolute and relative.
    verbose: let the native solver print.
    """

    tolerance: float = 1e-6
    max_iterations: int | None = None
    accept: Tolerances | None = None
    verbose: bool = False

    def __post_init__(self) -> None:
        """Raise `ValueError` for inconsistent options."""
        if not (math.isfinite(self.tolerance) and self.tolerance > 0.0):
            raise ValueError(f"tolerance must be positive and finite, got {self.tolerance}")
        if self.max_iterations is not None and self.max_iterations < 1:
            raise ValueError(f"max_iterations must be at least 1, got {self.max_iterations}")

    @property
    def acceptance(self) -> Tolerances:
        """The residuals that count as solved."""
        return self.accept or Tolerances(_ACCEPTANCE_FACTOR * self.tolerance, _ACCEPTANCE_FACTOR * self.tolerance)
