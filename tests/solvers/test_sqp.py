"""The iteration: every way to end, the deadline, monotony, and what it hands back."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest
import scipy.sparse as sp
from hock_schittkowski import BY_NUMBER, PROBLEMS, Problem
from hypothesis import given, settings
from hypothesis import strategies as st
from smooth_nlp import Functions, SmoothNLP
from solver_doubles import FakeClock, ScriptedBackend, raw

from solvers.backends.registry import make_backend
from solvers.globalization import Backtracking, TrustRegion
from solvers.nlp import ConvexModel, Measure
from solvers.outcome import Outcome
from solvers.qp import QP
from solvers.sqp import Options, QPOptions, solve
from solvers.status import Status

if TYPE_CHECKING:
    from solvers.backends.base import RawSolution

ACCURATE = Options(qp=QPOptions(tolerance=1e-9))
HS71 = BY_NUMBER[71]
LINE = Functions(lambda x: float(x[0]), lambda _x: np.ones(1))


class Quartic:
    """Minimise sum(x^4 - 8 x^2) / 4 over |x| <= 3 with majorisers: every iterate is feasible."""

    def __init__(self, clock: FakeClock | None = None, each_s: float = 0.0) -> None:
        self.clock, self.each_s = clock, each_s
        self.models = 0

    def measure(self, x: np.ndarray) -> Measure:
        return Measure(float((x**4 - 8 * x**2).sum() / 4), float(max(0.0, (abs(x) - 3).max())))

    def convexify(self, x: np.ndarray, radius: float) -> ConvexModel:
        self.models += 1
        if self.clock:
            self.clock.pass_s(self.each_s)
        n = x.size
        slope, curvature = x**3 - 4 * x, np.full(n, 23.0)
        lower, upper = np.maximum(-radius, -3 - x), np.minimum(radius, 3 - x)
        eye = sp.csc_array(np.eye(n))
        P = sp.csc_array((curvature, eye.indices, eye.indptr), shape=(n, n))
        return ConvexModel(
            QP(P, slope, eye, lower, upper),
            lambda p: x + p,
            lambda p: float(-(slope @ p + 0.5 * p @ (curvature * p))),
            start=np.zeros(n),
        )


def nowhere() -> SmoothNLP:
    """Minimise x subject to x^2 + 1 <= 0: the violation is least at 0."""
    return SmoothNLP(
        Functions(
            lambda x: float(x[0]),
            lambda _x: np.ones(1),
            inequalities=lambda x: x**2 + 1,
            inequality_jacobian=lambda x: 2 * x[None],
        ),
        1,
        weight=1e6,
    )


def test_infeasible_problem_ends_at_the_least_violation() -> None:
    found = solve(nowhere(), np.array([3.0]), make_backend("clarabel"), ACCURATE)
    assert found.outcome is Outcome.INFEASIBLE
    assert found.violation == pytest.approx(1.0, abs=1e-4)
    assert found.x == pytest.approx([0.0], abs=1e-2)


def test_a_weight_that_is_too_small_ends_at_an_infeasible_point() -> None:
    problem = BY_NUMBER[39]  # multipliers of 1
    options = replace(ACCURATE, max_iterations=200)
    found = solve(problem.nlp(weight=0.5), problem.x0, make_backend("clarabel"), options)
    assert found.outcome is Outcome.INFEASIBLE
    assert found.violation > 1e-3


def test_unbounded_problem_ends_by_the_limit() -> None:
    found = solve(SmoothNLP(LINE, 1), np.zeros(1), make_backend("clarabel"), replace(ACCURATE, max_iterations=30))
    assert found.outcome is Outcome.MAX_ITERATIONS
    assert found.iterations == 30
    assert found.objective < -1e3


def test_start_outside_the_domain() -> None:
    log = SmoothNLP(Functions(lambda _x: float("nan"), lambda x: x), 1)
    found = solve(log, np.array([-1.0]), make_backend("clarabel"))
    assert found.outcome is Outcome.INVALID_START
    assert found.x.tolist() == [-1.0]
    assert found.history == ()
    assert found.residuals is None


def test_steps_outside_the_domain_are_rejected() -> None:
    """Minimise x - log(x), from where the first models lead below 0."""

    def objective(x: np.ndarray) -> float:
        return float(x[0] - np.log(x[0])) if x[0] > 0 else float("nan")

    problem = SmoothNLP(Functions(objective, lambda x: 1 - 1 / x), 1)
    options = replace(ACCURATE, region=TrustRegion(8.0), line_search=Backtracking(most=0))
    found = solve(problem, np.array([5.0]), make_backend("clarabel"), options)
    assert found.outcome is Outcome.CONVERGED
    assert found.x == pytest.approx([1.0], abs=1e-3)


def test_derivatives_that_are_not_finite_end_it() -> None:
    problem = SmoothNLP(Functions(lambda x: float(x[0] ** 2), lambda x: x * np.nan), 1)
    found = solve(problem, np.ones(1), make_backend("clarabel"))
    assert found.outcome is Outcome.SUBPROBLEM_FAILED
    assert "q[0] = nan" in found.detail
    curved = replace(LINE, hessian=lambda _x, _eq, _ineq: np.full((1, 1), np.nan))
    found = solve(SmoothNLP(curved, 1), np.ones(1), make_backend("clarabel"))
    assert found.outcome is Outcome.SUBPROBLEM_FAILED
    assert "P.data[0] = nan" in found.detail


def test_constraints_that_are_not_finite_beyond_the_start() -> None:
    """Minimise -x subject to sqrt(1 - x) >= 0.5, whose first steps leave the domain."""

    def g(x: np.ndarray) -> np.ndarray:
        return 0.5 - np.sqrt(1 - x) if x[0] <= 1 else np.full(1, np.nan)

    functions = Functions(
        lambda x: float(-x[0]),
        lambda _x: -np.ones(1),
        inequalities=g,
        inequality_jacobian=lambda x: 0.5 / np.sqrt(1 - x)[None],
        hessian=lambda x, _eq, ineq: np.diag(ineq * 0.25 * (1 - x) ** -1.5),
    )
    found = solve(SmoothNLP(functions, 1), np.array([-3.0]), make_backend("clarabel"), ACCURATE)
    assert found.outcome is Outcome.CONVERGED
    assert found.x == pytest.approx([0.75], abs=1e-5)


@pytest.mark.parametrize("name", ["clarabel", "piqp"])
def test_stalled_when_the_model_lies(name: str) -> None:
    # the gradient has the wrong sign
    problem = SmoothNLP(Functions(lambda x: float(x[0] ** 2), lambda x: -2 * x), 1)
    options = replace(ACCURATE, region=TrustRegion(1.0, smallest=1e-4))
    found = solve(problem, np.ones(1), make_backend(name), options)
    assert found.outcome is Outcome.STALLED
    assert found.x.tolist() == [1.0]
    assert not any(iterate.accepted for iterate in found.history)


def test_stalled_when_no_step_keeps_its_promise() -> None:
    class Liar(Quartic):
        def measure(self, x: np.ndarray) -> Measure:
            return replace(super().measure(x), objective=float(abs(x - 1.0).max()))

    found = solve(Liar(), np.array([1.0]), make_backend("clarabel"), replace(ACCURATE, region=TrustRegion(1.0, 1e-4)))
    assert found.outcome is Outcome.STALLED
    assert found.x.tolist() == [1.0]


def test_small_steps() -> None:
    options = replace(ACCURATE, optimality=0.0, smallest_step=1e-3)
    found = solve(Quartic(), np.array([1.0]), make_backend("clarabel"), options)
    assert found.outcome is Outcome.SMALL_STEP
    assert found.history[-1].step <= 1e-3


# --- failing subproblems -----------------------------------------------------------------------------

FAILURES = set(Status) - {
    Status.SOLVED,
    Status.INACCURATE,
    Status.MAX_ITERATIONS,
    Status.TIME_LIMIT,
    Status.INTERRUPTED,
}


@pytest.mark.parametrize("status", sorted(FAILURES, key=lambda status: status.name))
def test_failures_in_a_row_end_it(status: Status) -> None:
    backend = ScriptedBackend(*[raw([9.0], [9.0], status)] * 3)
    found = solve(Quartic(), np.array([1.0]), backend)
    assert found.outcome is Outcome.SUBPROBLEM_FAILED
    assert status.sentence in found.detail
    assert found.iterations == 3
    assert found.x.tolist() == [1.0]
    grows = status is Status.PRIMAL_INFEASIBLE
    assert (found.history[1].radius > found.history[0].radius) == grows


def step_to(x: float, x_new: float, status: Status = Status.SOLVED) -> RawSolution:
    """Return what Quartic's subproblem at x answers if x_new is its solution within bounds."""
    return raw([x_new - x], [-(x**3 - 4 * x) - 23.0 * (x_new - x)], status)


def test_a_failure_in_between_is_survived() -> None:
    answers = [raw([9.0], [9.0], Status.NUMERICAL_ERROR), step_to(1.0, 1.0 + 3 / 23)]
    backend = ScriptedBackend(*answers, *[raw([9.0], [9.0], Status.UNKNOWN)] * 3)
    found = solve(Quartic(), np.array([1.0]), backend)
    assert [iterate.accepted for iterate in found.history] == [False, True, False, False, False]
    assert found.x == pytest.approx([1.0 + 3 / 23])


def test_an_inexact_solution_may_serve_as_a_step() -> None:
    backend = ScriptedBackend(step_to(1.0, 1.01, Status.MAX_ITERATIONS), *[raw([9.0], [9.0], Status.UNKNOWN)] * 3)
    found = solve(Quartic(), np.array([1.0]), backend)
    assert found.history[0].accepted
    assert found.history[0].qp_status is Status.MAX_ITERATIONS
    assert found.x.tolist() == [1.01]


def test_an_inexact_solution_proves_no_stationarity() -> None:
    backend = ScriptedBackend(*[step_to(1.0, 1.0, Status.MAX_ITERATIONS)] * 3)
    assert solve(Quartic(), np.array([1.0]), backend).outcome is Outcome.SUBPROBLEM_FAILED


def test_an_interrupt_ends_it() -> None:
    backend = ScriptedBackend(raw([0.0], [0.0], Status.INTERRUPTED))
    assert solve(Quartic(), np.array([1.0]), backend).outcome is Outcome.INTERRUPTED


# --- deadlines -----------------------------------------------------------------------------------------


def test_deadline_in_the_past(backend_name: str) -> None:
    problem = Quartic()
    found = solve(problem, np.ones(2), make_backend(backend_name), deadline=0.0)
    assert found.outcome is Outcome.DEADLINE
    assert found.x.tolist() == [1.0, 1.0]
    assert problem.models == 0


@given(st.floats(0.0, 40.0))
@settings(max_examples=20)
def test_whatever_the_deadline_the_best_so_far_is_returned(deadline: float) -> None:
    clock = FakeClock()
    problem = Quartic(clock, each_s=1.0)
    found = solve(problem, np.array([1.0, -3.0]), make_backend("piqp", clock), ACCURATE, clock, deadline)
    start = problem.measure(np.array([1.0, -3.0])).objective
    assert found.objective <= start
    assert found.objective == problem.measure(found.x).objective
    if found.outcome is Outcome.DEADLINE:
        assert problem.models <= np.ceil(deadline)
    else:
        assert found.outcome is Outcome.CONVERGED


def test_the_deadline_is_handed_on_to_each_subproblem() -> None:
    clock = FakeClock()
    answers = [step_to(1.0, 1.04), step_to(1.04, 1.08), raw([0.0], [9.0], Status.TIME_LIMIT)]
    backend = ScriptedBackend(*answers, clock=clock)
    found = solve(Quartic(clock, each_s=1.0), np.array([1.0]), backend, clock=clock, deadline=10.0)
    assert backend.limits == [9.0, 8.0, 7.0]
    assert found.outcome is Outcome.DEADLINE
    assert found.x.tolist() == [1.08]


def test_set_up_counts_against_the_deadline() -> None:
    clock = FakeClock()
    backend = ScriptedBackend(clock=clock)
    backend._setup = lambda _qp, _options: clock.pass_s(60.0)  # type: ignore[method-assign]
    found = solve(Quartic(), np.array([1.0]), backend, clock=clock, deadline=10.0)
    assert found.outcome is Outcome.DEADLINE
    assert backend.calls == ["warm_start"]
    assert found.x.tolist() == [1.0]


# --- what it hands back ----------------------------------------------------------------------------------


@given(st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=3))
@settings(max_examples=30)
def test_feasible_models_make_the_objective_monotone(start: list[float]) -> None:
    problem = Quartic()
    found = solve(problem, np.array(start), make_backend("piqp"), ACCURATE)
    values = [problem.measure(np.array(start)).objective, *(iterate.objective for iterate in found.history)]
    assert all(after <= before for before, after in pairwise(values))
    assert all(iterate.violation <= 1e-9 for iterate in found.history)
    assert found.outcome is Outcome.CONVERGED
    assert found.objective == min(values)
    # every coordinate at a stationary point: 0 or +-2
    assert (found.x**3 - 4 * found.x) == pytest.approx(np.zeros(len(start)), abs=2e-2)


@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda problem: f"HS{problem.number}")
def test_best_of_the_history_is_returned(problem: Problem) -> None:
    found = solve(problem.nlp(), problem.x0, make_backend("piqp"), replace(ACCURATE, max_iterations=6))
    at_x = problem.nlp().measure(found.x)
    assert (found.objective, found.violation) == (at_x.objective, at_x.violation)
    feasible = [iterate.objective for iterate in found.history if iterate.violation <= 1e-6]
    if feasible:
        assert found.violation <= 1e-6
        assert found.objective <= min(feasible)
    else:
        assert found.violation <= min(iterate.violation for iterate in found.history)


def test_the_back_end_is_set_up_once() -> None:
    backend = make_backend("clarabel")
    counted, setup = [], backend.setup

    def count(qp: QP, options: QPOptions | None = None) -> None:
        counted.append(options)
        setup(qp, options)

    backend.setup = count  # type: ignore[method-assign]
    solve(HS71.nlp(), HS71.x0, backend, ACCURATE)
    solve(HS71.nlp(), HS71.x0 + 0.1, backend, ACCURATE)
    assert counted == [ACCURATE.qp]


def test_multipliers_of_the_last_subproblem() -> None:
    found = solve(HS71.nlp(), HS71.x0, make_backend("clarabel"), ACCURATE)
    assert found.multipliers is not None
    # equality and product constraint, as printed in the IPOPT tutorial on this problem
    assert found.multipliers[:2] == pytest.approx([0.1614686, 0.5522937], abs=1e-3)
    assert found.residuals is not None
    assert found.residuals.dual < 1e-6


def test_history_is_complete() -> None:
    clock = FakeClock()
    found = solve(Quartic(clock, 1.0), np.array([1.0]), make_backend("piqp", clock), ACCURATE, clock)
    assert [iterate.time_s for iterate in found.history] == list(range(1, found.iterations + 1))
    assert all(iterate.qp_time_s == 1.0 for iterate in found.history)
    assert all(iterate.qp_status is Status.SOLVED and iterate.qp_iterations > 0 for iterate in found.history)
    assert found.history[0].radius == 1.0
    assert found.history[0].predicted > 0.0


def test_line_search_shortens_a_step_that_overshoots() -> None:
    problem = BY_NUMBER[1]
    options = replace(ACCURATE, region=TrustRegion(10.0))
    with_search = solve(problem.nlp(), problem.x0, make_backend("clarabel"), options)
    without = solve(
        problem.nlp(), problem.x0, make_backend("clarabel"), replace(options, line_search=Backtracking(most=0))
    )
    assert with_search.outcome is without.outcome is Outcome.CONVERGED
    rejected = sum(not iterate.accepted for iterate in with_search.history)
    assert rejected < sum(not iterate.accepted for iterate in without.history)


@pytest.mark.parametrize(
    "bad",
    [
        {"max_iterations": -1},
        {"failures": 0},
        {"optimality": -1.0},
        {"feasibility": np.nan},
        {"smallest_step": np.inf},
        {"sufficient": 0.0},
        {"sufficient": 1.0},
    ],
)
def test_options_under_which_it_cannot_work(bad: dict) -> None:
    with pytest.raises(ValueError, match="got"):
        Options(**bad)


def test_no_iterations() -> None:
    found = solve(Quartic(), np.ones(1), make_backend("piqp"), Options(max_iterations=0))
    assert found.outcome is Outcome.MAX_ITERATIONS
    assert found.iterations == 0
