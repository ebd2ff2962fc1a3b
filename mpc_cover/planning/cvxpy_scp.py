"""Sequential convex programming with the subproblem in CVXPY, a user's terms and constraints among it.

The stages are those of `planning.scp`; terms are part of the merit. An iterate that violates a user's constraint is
first restored: moved to the nearest motion that keeps it, without a trust region.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cvxpy as cp
import numpy as np

from mpc_cover.errors import UserError
from mpc_cover.planning.coverage_nlp import CoverageNLP
from mpc_cover.planning.cvxpy_extra.statuses import INFEASIBLE, UNBOUNDED
from mpc_cover.planning.scp import SHARPNESS, length_scale
from solvers.globalization import TrustRegion

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.cvxpy_problem import Found, UserProblem

_ITERATIONS = 10
"""Subproblems of a stage, as in `scp.optimise`."""
_FAILURES = 3
"""Failed subproblems in a row that end a stage, as in `solvers.sqp_options`."""
_NEGLIGIBLE = 3e-3
"""Predicted decrease relative to max(1, merit) below which a stage has converged, as in `scp`."""
_NEGLIGIBLE_AT_LAST = 1e-5
"""The same in the last stage, after which nothing takes up what is left; a plain choice."""
_SUFFICIENT = 1e-4
"""Share of the predicted decrease that makes a step acceptable, as in `solvers.sqp_options`."""
_RESTORATIONS = 8
"""Subproblems in which an iterate is to be brought to a user's constraints; a plain choice."""
_RESTORED = 0.9
"""Part of the violation that a restoration may leave, or it has come to its end; a plain choice."""


def restored(problem: UserProblem, x: FloatArray, budget: Budget) -> tuple[FloatArray, str]:
    """Return a decision vector that keeps the user's constraints, or violates them less, and CVXPY's status of it."""
    status, judged = str(cp.OPTIMAL), problem.judged(x)
    for _ in range(_RESTORATIONS):
        if judged is None or judged.holds:
            return x, str(cp.OPTIMAL)
        if budget.exhausted:
            break
        status, nearest = problem.nearest(x)
        candidate = problem.nearer(x) if nearest is None and status in INFEASIBLE else nearest
        if candidate is None:
            break
        now = problem.judged(candidate)
        assert now is not None
        if not now.violation <= _RESTORED * judged.violation:
            break
        x, judged = candidate, now
    return x, status


def optimise_with_cvxpy(
    problem: UserProblem, x: FloatArray, budget: Budget, keep: Callable[[Found], None] = lambda _: None
) -> Found:
    """Decrease J with the user's terms from a decision vector, stage by stage; anytime, as `scp.optimise`.

    `keep` is called with each motion that is the best so far.

    Raises
    ------
    UserError
        The user's terms have no lower bound, or as `UserProblem.solve`.
    """
    best = problem.found(x)
    for sharpness in SHARPNESS:
        if budget.exhausted or best.complete:
            break
        negligible = _NEGLIGIBLE if sharpness < SHARPNESS[-1] else _NEGLIGIBLE_AT_LAST
        nlp = CoverageNLP(problem.ocp, problem.settings(sharpness))
        x, best = _stage(problem, nlp, x, best, negligible, budget, keep)
    return best


def _stage(
    problem: UserProblem,
    nlp: CoverageNLP,
    x: FloatArray,
    best: Found,
    negligible: float,
    budget: Budget,
    keep: Callable[[Found], None],
) -> tuple[FloatArray, Found]:
    """Return the last iterate of a stage, and the best motion until then."""
    region, failures, merit = _region(length_scale(problem.ocp)), 0, problem.merit(nlp, x)
    for _ in range(_ITERATIONS):
        if budget.exhausted or failures >= _FAILURES or region.exhausted or best.complete:
            break
        status, candidate, value = problem.step(nlp, x, region.radius)
        if status in UNBOUNDED:
            raise UserError(_unbounded(problem, status))
        if candidate is None:
            failures += 1
            region = region.resized((region.grow if status in INFEASIBLE else region.shrink) * region.radius)
            continue
        predicted, new = merit - value, problem.merit(nlp, candidate)
        if predicted <= negligible * max(1.0, abs(merit)):
            break
        length = float(np.abs(problem.ocp.motion(candidate)[0] - problem.ocp.motion(x)[0]).max())
        if not merit - new >= _SUFFICIENT * predicted:
            region = region.rejected(length)
            continue
        region, failures = region.accepted((merit - new) / predicted, length), 0
        x, merit = candidate, new
        if (found := problem.found(x)).rank < best.rank:
            best = found
            keep(best)
    return x, best


def _region(scale: float) -> TrustRegion:
    """Return the trust region that `scp.optimise` begins a stage with."""
    return TrustRegion(scale, smallest=0.01 * scale, largest=2.0 * scale, shrink=0.4, grow=1.5)


def _unbounded(problem: UserProblem, status: str) -> str:
    name = problem.extra.name if problem.extra is not None else "none"
    return f"extra {name}: its terms have no lower bound: CVXPY's status is {status} ({problem.log.solver})"
