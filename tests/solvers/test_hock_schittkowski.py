"""The iteration on problems with known solutions, with every back-end."""

from __future__ import annotations

import numpy as np
import pytest
from hock_schittkowski import PROBLEMS, Problem

from solvers.backends.registry import make_backend
from solvers.outcome import Outcome
from solvers.sqp import Options, QPOptions, solve

# back-end: options, and how close objective and point come
ACCURATE = (Options(optimality=1e-9, qp=QPOptions(tolerance=1e-9)), 1e-6, 1e-5)
ACCURACY = {
    "clarabel": ACCURATE,
    "piqp": ACCURATE,
    "native": ACCURATE,
    "osqp": (Options(optimality=1e-7, qp=QPOptions(tolerance=1e-6)), 1e-5, 1e-3),
}


@pytest.mark.parametrize("exact", [False, True], ids=["BFGS", "exact Hessian"])
@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda problem: f"HS{problem.number}")
def test_known_solution_is_found(problem: Problem, backend_name: str, exact: bool) -> None:
    options, near, close = ACCURACY[backend_name]
    found = solve(problem.nlp(exact=exact), problem.x0, make_backend(backend_name), options)
    assert found.outcome is Outcome.CONVERGED
    assert found.violation <= options.feasibility
    assert found.objective == pytest.approx(problem.best, rel=near, abs=near)
    if problem.solution is not None:
        assert found.x == pytest.approx(problem.solution, abs=close)
    assert found.residuals is not None
    assert found.iterations == len(found.history) <= 50


@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda problem: f"HS{problem.number}")
def test_the_stated_solution_is_one(problem: Problem) -> None:
    if problem.solution is not None:
        at = problem.nlp().measure(np.array(problem.solution))
        assert at.objective == pytest.approx(problem.best, abs=1e-6)
        assert at.violation <= 1e-5
