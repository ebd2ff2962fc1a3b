"""Acceptance of QP solutions: the status follows from the residuals rather than from the library's status."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solvers.status import Status

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solvers.residuals import Residuals, Tolerances

OVERRULABLE = frozenset(
    {
        Status.SOLVED,
        Status.INACCURATE,
        Status.MAX_ITERATIONS,
        Status.TIME_LIMIT,
        Status.NUMERICAL_ERROR,
        Status.UNKNOWN,
    }
)
"""Native statuses that small residuals overrule; certificates of infeasibility are not among them."""


@dataclass(frozen=True)
class RawSolution:
    """The native solver's result with its status translated, before residuals are checked."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    status: Status
    iterations: int
    detail: str
    cone_dual: NDArray[np.float64] | None = None


def accepted_status(raw: RawSolution, residuals: Residuals, acceptance: Tolerances) -> Status:
    """Return the status of a raw solution in the light of its residuals."""
    if raw.status not in OVERRULABLE:
        return raw.status
    if not (np.isfinite(raw.x).all() and np.isfinite(raw.y).all()):
        return Status.NUMERICAL_ERROR
    if residuals.within(acceptance):
        return Status.SOLVED
    return Status.INACCURATE if raw.status is Status.SOLVED else raw.status
