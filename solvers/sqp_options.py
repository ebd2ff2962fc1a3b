"""Options of `solvers.sqp`."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from solvers.backends.options import Options as QPOptions
from solvers.globalization import Backtracking, TrustRegion

__all__ = ["Options", "QPOptions"]


@dataclass(frozen=True)
class Options:
    """Options of the SQP iteration.

    Attributes
    ----------
    max_iterations: largest number of subproblems.
    optimality: predicted decrease, relative to max(1, |J|), below which a point counts as stationary.
    feasibility: violation below which a point counts as feasible.
    smallest_step: step length below which the iteration ends.
    sufficient: share of the predicted decrease that makes a step acceptable.
    region: the initial trust region.
    line_search: applied to rejected steps.
    failures: failed subproblems in a row that end the iteration.
    qp: options of the back-end.
    """

    max_iterations: int = 100
    optimality: float = 1e-9
    feasibility: float = 1e-6
    smallest_step: float = 1e-10
    sufficient: float = 1e-4
    region: TrustRegion = field(default_factory=lambda: TrustRegion(1.0))
    line_search: Backtracking = field(default_factory=Backtracking)
    failures: int = 3
    qp: QPOptions = field(default_factory=QPOptions)

    def __post_init__(self) -> None:
        """Raise `ValueError` for inconsistent options."""
        if self.max_iterations < 0 or self.failures < 1:
            raise ValueError(f"max_iterations >= 0 and failures >= 1 are wanted, got {self}")
        for name in ("optimality", "feasibility", "smallest_step"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} must be finite and not negative, got {value}")
        if not 0.0 < self.sufficient < 1.0:
            raise ValueError(f"sufficient must be in (0, 1), got {self.sufficient}")
