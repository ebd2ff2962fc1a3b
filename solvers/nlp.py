"""What a problem must offer so that `solvers.sqp` can solve it by a sequence of convex QPs.

    minimise J(x) subject to x in D                                             (A.1)

The iteration asks for two things only: how good a point is, and a convex model around it.
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
    """How good a point is.

    Attributes
    ----------
    objective: J(x).
    violation: the worst violation of a constraint, >= 0 (infinity norm).
    penalty: the sum of the violations (l1 norm); what the merit function weighs.
    """

    objective: float
    violation: float
    penalty: float = 0.0

    def merit(self, weight: float) -> float:
        """Return the l1 merit J + weight * penalty; infinite where J is not a number."""
        value = self.objective + weight * self.penalty
        return value if math.isfinite(value) else math.inf


@dataclass(frozen=True)
class ConvexModel:
    """A convex QP around a point, and the way back from its variables.

    Attributes
    ----------
    qp: the subproblem. Keep its pattern from one iteration to the next and it is updated in place.
    recover: QP's x -> the next point.
    predicted: QP's x -> the decrease of the merit that the model promises, penalty included.
    weight: the weight of the penalty in that merit; 0 for models that keep every iterate feasible.
    start: where to start the QP from (n of the QP), or None for its last solution.
    length: next point -> the length of the step in the radius's units; None for the infinity norm of x.
    """

    qp: QP
    recover: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    predicted: Callable[[NDArray[np.float64]], float]
    weight: float = 0.0
    start: NDArray[np.float64] | None = None
    length: Callable[[NDArray[np.float64]], float] | None = None


class Convexifiable(Protocol):
    """A problem that can be measured and convexified at any point. Points are (n,) arrays."""

    def measure(self, x: NDArray[np.float64]) -> Measure:
        """Return how good `x` is; NaN or inf where it is outside the domain."""
        ...

    def convexify(self, x: NDArray[np.float64], radius: float) -> ConvexModel:
        """Return a model that is trusted within `radius` of `x` (infinity norm)."""
        ...


@runtime_checkable
class StepObserver(Protocol):
    """A problem that wants to hear of accepted steps, say to record them, or to update a quasi-Newton Hessian."""

    def accepted(
        self, x_old: NDArray[np.float64], x_new: NDArray[np.float64], multipliers: NDArray[np.float64]
    ) -> None:
        """Learn from a step; `multipliers` are those of the rows of the subproblem's A."""
        ...
