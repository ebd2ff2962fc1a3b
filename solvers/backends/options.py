"""What a caller may ask of any back-end."""

from __future__ import annotations

import math
from dataclasses import dataclass

from solvers.residuals import Tolerances


@dataclass(frozen=True)
class Options:
    """What a caller may ask of any back-end.

    Attributes
    ----------
    tolerance: eps_abs = eps_rel of the native solver.
    max_iterations: None for the default of the back-end's file.
    accept: residuals that count as solved; None for ten times `tolerance`, absolute and relative.
    verbose: let the native solver print.
    """

    tolerance: float = 1e-6
    max_iterations: int | None = None
    accept: Tolerances | None = None
    verbose: bool = False

    def __post_init__(self) -> None:
        """Raise `ValueError` for options that no solver can meet."""
        if not (math.isfinite(self.tolerance) and self.tolerance > 0.0):
            raise ValueError(f"tolerance must be positive and finite, got {self.tolerance}")
        if self.max_iterations is not None and self.max_iterations < 1:
            raise ValueError(f"max_iterations must be at least 1, got {self.max_iterations}")

    @property
    def acceptance(self) -> Tolerances:
        """The residuals that count as solved."""
        return self.accept or Tolerances(10.0 * self.tolerance, 10.0 * self.tolerance)
