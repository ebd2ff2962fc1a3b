"""The interface of nonlinear problems that `solvers.sqp` solves by a sequence of convex QPs.

    minimise J(x) subject to x in D                                             (A.1)

The iteration needs the objective and violation at a point, and a convex model around it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from solvers.qp import QP


@dataclass(frozen=True)
class Measure:
    """Objective and constraint violation at a point.

    Attributes
    ----------
    objective: J(x).
    violation: the largest violation of a constraint, >= 0 (infinity norm).
    penalty: the sum of the violations (l1 norm), as weighted in the merit function.
    """

    objective: float
    violation: float
    penalty: float = 0.0

    def merit(self, weight: float) -> float:
        """Return the l1 merit J + weight * penalty; infinite where that is not finite."""
        value = self.objective + weight * self.penalty
        return value if math.isfinite(value) else math.inf


@dataclass(frozen=True)
class ConvexModel:
    """A convex QP around a point, and the map from its variables to the next point.

    Attributes
    ----------
    qp: the subproblem. If its sparsity pattern stays the same between iterations it is updated in place.
    recover: QP's x -> the next point.
    predicted: QP's x -> the predicted decrease of the merit, penalty included.
    weight: the weight of the penalty in that merit; 0 for models that keep every iterate feasible.
    start: starting point of the QP (n of the QP), or None for its last solution.
    length: next point -> the length of the step in the radius's units; None for the infinity norm of x.
    """

    qp: QP
    recover: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    predicted: Callable[[NDArray[np.float64]], float]
    weight: float = 0.0
    start: NDArray[np.float64] | None = None
    length: Callable[[NDArray[np.float64]], float] | None = None


class Convexifiable(Protocol):
    """A problem that can be evaluated and convexified at any point. Points are (n,) arrays."""

    def measure(self, x: NDArray[np.float64]) -> Measure:
        """Return objective and violation at `x`; NaN or inf outside the domain."""
        ...

    def convexify(self, x: NDArray[np.float64], radius: float) -> ConvexModel:
        """Return a convex model with a trust region of `radius` around `x` (infinity norm)."""
        ...


@runtime_checkable
class StepObserver(Protocol):
    """A problem that is notified of accepted steps, for example to update a quasi-Newton Hessian."""

    def accepted(
        self, x_old: NDArray[np.float64], x_new: NDArray[np.float64], multipliers: NDArray[np.float64]
    ) -> None:
        """Process an accepted step; `multipliers` (m,) are those of the rows of the subproblem's A."""
        ...
