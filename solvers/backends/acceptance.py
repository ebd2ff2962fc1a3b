"""Residuals, not a library's word, decide whether a QP is solved."""

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
"""Native outcomes that good residuals overrule; a proof of infeasibility is not among them."""


@dataclass(frozen=True)
class RawSolution:
    """What the native solver said, translated but not judged."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    status: Status
    iterations: int
    detail: str
    cone_dual: NDArray[np.float64] | None = None


def accepted_status(raw: RawSolution, residuals: Residuals, acceptance: Tolerances) -> Status:
    """Return the status that the residuals of a raw solution warrant."""
    if raw.status not in OVERRULABLE:
        return raw.status
    if not (np.isfinite(raw.x).all() and np.isfinite(raw.y).all()):
        return Status.NUMERICAL_ERROR
    if residuals.within(acceptance):
        return Status.SOLVED
    return Status.INACCURATE if raw.status is Status.SOLVED else raw.status
