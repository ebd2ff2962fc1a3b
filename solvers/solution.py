"""The solution that a back-end returns for a QP."""

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
    """The solution of a QP; `status` follows from the residuals, not from the library's status alone.

    Attributes
    ----------
    x: (n,), NaN where the library returned none.
    y: (m,), multipliers of l <= A x <= u, positive at the upper bound (OSQP's convention):
        P x + q + A'y - G'cone_dual = 0.
    setup_time_s: time of set-ups since the last solve [s]; 0 after updates in place.
    solve_time_s: time of this solve alone [s].
    cone_dual: (k,), multipliers of the cones, or None.
    detail: the library's own name for the outcome, or the exception that it raised.
    backend: name of the back-end.
    work_per_entry_s: time of its iterations per stored entry of A [s], by the pace that the back-end declares.
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
    backend: str = ""
    work_per_entry_s: float = 0.0

    @property
    def ok(self) -> bool:
        """Whether the solution may be used without further checks."""
        return self.status.ok
