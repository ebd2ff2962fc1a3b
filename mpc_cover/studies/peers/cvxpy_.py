"""Our own subproblem in CVXPY, canonicalised in every iteration: what `planning.cvxpy_reference` costs in a loop.

Stages, trust region and acceptance are those of `planning.scp` and `solvers.sqp`, without the line search.
Solved by Clarabel, CVXPY's default for these problems; most of the time goes into canonicalisation.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import cvxpy as cp
import numpy as np

from mpc_cover.planning.coverage_nlp import CoverageNLP
from mpc_cover.planning.cvxpy_reference import build_cvxpy_subproblem
from mpc_cover.planning.ocp import Settings
from mpc_cover.planning.scp import SHARPNESS, length_scale, softness_at
from solvers.globalization import TrustRegion

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.studies.case import Case
    from mpc_cover.studies.watch import Answer, Watch

_ITERATIONS = 10
"""Subproblems a stage, as in `planning.scp.optimise`."""
_NEGLIGIBLE = 3e-3
"""Predicted decrease relative to max(1, J) below which a stage has converged."""


def canonicalised(case: Case, x: FloatArray, watch: Watch, *, solver: str = "CLARABEL") -> Answer:
    """Run the sequential convexification with CVXPY's problems."""
    count = 0
    watch.begin(x)
    for sharpness in SHARPNESS:
        problem = CoverageNLP(case.ocp, Settings(softness_at(sharpness, length_scale(case.ocp))))
        region = _region(length_scale(case.ocp))
        for _ in range(_ITERATIONS):
            if watch.enough:
                return watch.answer(x, count, "everything is covered" if watch.complete else "time is up")
            count += 1
            found = _proposed(problem, x, region.radius, solver)
            merit = problem.measure(x).merit(problem.settings.penalty)
            predicted = merit - found[1] if found else 0.0
            if found is None or predicted <= _NEGLIGIBLE * max(1.0, merit):
                break
            decrease = merit - problem.measure(found[0]).merit(problem.settings.penalty)
            step = float(np.abs(case.ocp.motion(found[0])[0] - case.ocp.motion(x)[0]).max())
            if decrease < 1e-4 * predicted:
                region = region.rejected(step)
                if region.exhausted:
                    break
                continue
            x, region = found[0], region.accepted(decrease / predicted, step)
            watch.see(x)
    return watch.answer(x, count, "all stages are done")


def _region(scale: float) -> TrustRegion:
    """Return the trust region that `optimise` begins a stage with."""
    return TrustRegion(scale, smallest=0.01 * scale, largest=2.0 * scale, shrink=0.4, grow=1.5)


def _proposed(problem: CoverageNLP, x: FloatArray, radius: float, solver: str) -> tuple[FloatArray, float] | None:
    """Return the subproblem's point and optimal value, or None if the solver failed."""
    ocp = problem.ocp
    reference = build_cvxpy_subproblem(ocp, problem.settings, problem.requirements, x, radius)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # on accuracy: the merit judges the step
            value = reference.solve(solver)
    except cp.error.SolverError:
        return None
    if not np.isfinite(value):
        return None
    return ocp.exact_ends(ocp.decision(reference.position.value[0], reference.velocity.value)), value
