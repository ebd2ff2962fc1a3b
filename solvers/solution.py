"""What a back-end hands back of a QP."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from solvers.residuals import Residuals
    from solvers.status import Status


@dataclass(frozen=True)
class QPSolution:
    """What a back-end hands back; `status` is judged by the residuals, not by the library's word.

    Attributes
    ----------
    x: (n,), NaN where the library gave nothing.
    y: (m,), multipliers of l <= A x <= u, positive at the upper bound (OSQP's convention):
        P x + q + A'y - G'cone_dual = 0.
    setup_time_s: set-ups charged to this solve [s]; 0 after mere updates.
    solve_time_s: this solve alone [s].
    cone_dual: (k,), multipliers of the cones, or None.
    detail: the library's own word for the outcome, or the exception that it died of.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    status: Status
    residuals: Residuals
    iterations: int
    setup_time_s: float
    solve_time_s: float
    cone_dual: NDArray[np.float64] | None = None
    detail: str = field(default="")

    @property
    def ok(self) -> bool:
        """Whether the solution may be used without a second look."""
        return self.status.ok
