"""Outcomes of a QP solve, the same for every back-end, with a sentence each for messages."""

from __future__ import annotations

from enum import Enum


class Status(Enum):
    """How a QP solve ended; the value is a sentence for messages.

    Every native status of every back-end maps to one of these (the map is in the back-end's module);
    statuses that later versions of a library add map to `UNKNOWN`.
    """

    SOLVED = "The residuals of the solution are within tolerance."
    INACCURATE = "The solver claims a solution, but its residuals are above the tolerance."
    MAX_ITERATIONS = "The limit on iterations was reached before the residuals were within tolerance."
    TIME_LIMIT = "The time limit was reached before the residuals were within tolerance."
    PRIMAL_INFEASIBLE = "No point satisfies the constraints."
    DUAL_INFEASIBLE = "The objective is unbounded below on the constraints."
    NON_CONVEX = "The quadratic term is not positive semi-definite."
    NUMERICAL_ERROR = "The solver broke down numerically; its result is not to be used."
    INVALID_DATA = "The solver refused the problem's data or its own settings."
    INTERRUPTED = "The solve was interrupted from outside."
    UNKNOWN = "The solver ended with a status that this version does not know."

    @property
    def sentence(self) -> str:
        """The outcome as a sentence for messages."""
        return self.value

    @property
    def ok(self) -> bool:
        """Whether the solution may be used without further checks."""
        return self is Status.SOLVED
