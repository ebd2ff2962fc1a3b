"""The result of a run of `solvers.sqp`, and the history of its iterations."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from solvers.residuals import Residuals
    from solvers.status import Status


class Outcome(Enum):
    """Why the iteration ended; the value is a sentence for messages."""

    CONVERGED = "The model predicts no further decrease: a stationary point within tolerance."
    SMALL_STEP = "The steps have become too small to matter."
    MAX_ITERATIONS = "The limit on iterations was reached."
    DEADLINE = "The deadline was reached."
    STALLED = "No step within the smallest trust region decreases the merit."
    INFEASIBLE = "A stationary point of the constraint violation: no feasible point was found near it."
    SUBPROBLEM_FAILED = "The convex subproblem could not be solved."
    INTERRUPTED = "A subproblem was interrupted from outside."
    INVALID_START = "The objective or the constraints are not finite at the starting point."

    @property
    def sentence(self) -> str:
        """The outcome as a sentence for messages."""
        return self.value


@dataclass(frozen=True)
class Iterate:
    """One iteration: the point at its end, the trust region, the step, and its QP. Times in seconds."""

    objective: float
    violation: float
    radius: float
    step: float
    accepted: bool
    predicted: float
    qp_status: Status
    qp_iterations: int
    qp_time_s: float
    time_s: float


@dataclass(frozen=True)
class Result:
    """The result of a run, whatever ended it.

    Attributes
    ----------
    x: (n,), the feasible point with the least objective, or the least violated point if none is feasible.
    objective, violation: of that point.
    iterations: number of subproblems.
    history: one entry per subproblem.
    multipliers: (m,) of the last subproblem's rows, or None; `residuals`: its KKT residuals.
    detail: the back-end's message on a subproblem that failed.
    """

    x: NDArray[np.float64]
    objective: float
    violation: float
    outcome: Outcome
    iterations: int
    history: tuple[Iterate, ...]
    multipliers: NDArray[np.float64] | None = None
    residuals: Residuals | None = None
    detail: str = ""
