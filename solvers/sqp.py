"""Sequential convex programming: the iteration of Appendix A with a globalisation strategy; an anytime method.

Each iteration solves the convex model of the problem around the last accepted point, within a trust
region. A step that decreases the l1 merit (J + weight * penalty) enough is taken; otherwise shorter steps in the
same direction are tried, and then the region shrinks. Nocedal & Wright, Numerical Optimization, 2nd ed., section 18.5.

Where every model keeps its points feasible (inner approximations) the penalty is zero and the objective
decreases from iterate to iterate. Whenever the run ends, the best point found is returned.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from solvers.iteration import Iteration
from solvers.outcome import Iterate, Outcome, Result
from solvers.sqp_options import Options, QPOptions

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from solvers.backends.base import Backend
    from solvers.nlp import Convexifiable

__all__ = ["Iterate", "Options", "Outcome", "QPOptions", "Result", "solve"]


def solve(
    problem: Convexifiable,
    x0: NDArray[np.float64],
    backend: Backend,
    options: Options | None = None,
    clock: Callable[[], float] = time.perf_counter,
    deadline: float | None = None,
) -> Result:
    """Minimise from `x0`: (n,); never raises for numerical reasons.

    Parameters
    ----------
    problem: the problem; it may also implement `solvers.nlp.StepObserver`.
    backend: QP solver; if its last problem has the same sparsity pattern, it is updated in place.
    clock: monotonic time [s].
    deadline: on that clock [s], None for none; checked before each subproblem, which gets the time left as its limit.
    """
    return Iteration(problem, x0, backend, options or Options(), clock, deadline).run()
