"""The elastic subproblem: its data, its promise, and its way out of infeasible linearisations."""

from __future__ import annotations

import numpy as np
import pytest
from hock_schittkowski import BY_NUMBER, PROBLEMS, Problem, gradient, jacobian
from hypothesis import given
from hypothesis import strategies as st
from smooth_nlp import Functions, SmoothNLP

from solvers.backends.options import Options
from solvers.backends.registry import make_backend
from solvers.nlp import StepObserver

HS71 = BY_NUMBER[71]
LINE = Functions(lambda x: float(x[0]), lambda _x: np.ones(1))


@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda problem: f"HS{problem.number}")
def test_derivatives_of_the_collection(problem: Problem) -> None:
    x = problem.x0 + 0.1
    pairs = [(lambda z: np.array([problem.objective(z)]), lambda z: gradient(problem.objective)(z)[None])]
    pairs += [(f, jacobian(f)) for f in (problem.equalities, problem.inequalities) if f]
    for function, derivative in pairs:
        columns = [(np.array(function(x + 1e-6 * e)) - np.array(function(x - 1e-6 * e))) / 2e-6 for e in np.eye(x.size)]
        assert derivative(x) == pytest.approx(np.array(columns).T, rel=1e-5, abs=1e-4)


def test_measure() -> None:
    at = HS71.nlp().measure(np.array([0.0, 5.0, 5.0, 6.0]))
    # h = 86 - 40, g = 25 - 0, out of bounds by 1 and 1
    assert at.violation == 46.0
    assert at.penalty == 46.0 + 25.0 + 1.0 + 1.0
    assert at.objective == 5.0
    assert at.merit(2.0) == 151.0


def test_subproblem_is_valid_and_keeps_its_pattern() -> None:
    nlp = HS71.nlp()
    one, two = nlp.convexify(HS71.x0, 1.0).qp, nlp.convexify(HS71.x0 + 0.3, 0.1).qp
    one.validate()
    assert one.same_pattern(two)
    # p, s+, s-, t; h, g, bounds of p and of the slacks
    assert (one.n, one.m) == (7, 9)


def test_subproblem_by_hand() -> None:
    """Minimise x0^2 + x1 subject to x0 x1 = 2, x0 - 3 <= 0, 0 <= x1 <= 10, at (1, 4)."""
    functions = Functions(
        lambda x: float(x[0] ** 2 + x[1]),
        lambda x: np.array([2 * x[0], 1.0]),
        lambda x: np.array([x[0] * x[1] - 2]),
        lambda x: np.array([[x[1], x[0]]]),
        lambda x: np.array([x[0] - 3]),
        lambda _x: np.array([[1.0, 0.0]]),
        lambda _x, eq, _ineq: np.array([[2.0, eq[0]], [eq[0], 0.0]]),
    )
    nlp = SmoothNLP(functions, 2, np.array([-np.inf, 0.0]), np.array([np.inf, 10.0]), weight=7.0)
    qp = nlp.convexify(np.array([1.0, 4.0]), 5.0).qp
    wanted = [[4, 1, -1, 1, 0], [1, 0, 0, 0, -1]]
    np.testing.assert_array_equal(qp.A.toarray()[:2], wanted)
    np.testing.assert_array_equal(qp.A.toarray()[2:], np.eye(5))
    assert qp.q.tolist() == [2, 1, 7, 7, 7]
    assert qp.l.tolist() == [-2, -np.inf, -5, -4, 0, 0, 0]
    assert qp.u.tolist() == [-2, 2, 5, 5, np.inf, np.inf, np.inf]
    assert np.diag(qp.P.toarray())[:2] == pytest.approx([2.0, 0.0], abs=1e-7)
    # with a multiplier of 1 the Hessian [[2, 1], [1, 0]] is made positive
    nlp.accepted(np.array([1.0, 4.0]), np.array([1.0, 3.0]), np.array([1.0, 0.5, 0, 0, 0, 0, 0]))
    P = nlp.convexify(np.array([1.0, 3.0]), 5.0).qp.P.toarray()[:2, :2]
    P = P + P.T - np.diag(np.diag(P))
    values, vectors = np.linalg.eigh([[2.0, 1.0], [1.0, 0.0]])
    np.testing.assert_allclose(P, (vectors * np.maximum(values, 0.0)) @ vectors.T, atol=1e-6)


@given(st.integers(0, 1000))
def test_promise_is_exact_for_a_linearly_constrained_quadratic(seed: int) -> None:
    problem, rng = BY_NUMBER[76], np.random.default_rng(seed)
    nlp, x = problem.nlp(exact=True, weight=3.0), problem.x0 + rng.normal(size=4)
    model = nlp.convexify(x, 10.0)
    qp_x = np.concatenate((rng.normal(size=4), np.zeros(3)))
    x_new = x + qp_x[:4]
    actual = nlp.measure(x).merit(model.weight) - nlp.measure(x_new).merit(model.weight)
    assert model.predicted(qp_x) == pytest.approx(actual, abs=1e-6)


def test_infeasible_linearisation_has_a_solution(backend_name: str) -> None:
    # x0^2 >= 1 and x0 = 0.1: far outside what a radius of 0.1 can reach, and contradictory
    functions = Functions(
        lambda x: float(x[0]),
        lambda _x: np.ones(1),
        lambda x: np.array([x[0] - 0.1]),
        lambda _x: np.ones((1, 1)),
        lambda x: np.array([1 - x[0] ** 2]),
        lambda x: np.array([[-2 * x[0]]]),
    )
    model = SmoothNLP(functions, 1).convexify(np.array([0.5]), 0.1)
    backend = make_backend(backend_name)
    backend.setup(model.qp, Options(tolerance=1e-6))
    found = backend.solve()
    assert found.ok
    assert model.predicted(found.x) >= -1e-5


def test_out_of_bounds_is_led_back_as_far_as_the_radius_allows() -> None:
    nlp = SmoothNLP(LINE, 1, np.array([2.0]), np.array([3.0]))
    qp = nlp.convexify(np.array([-5.0]), 1.0).qp
    assert (qp.l.tolist(), qp.u.tolist()) == ([1.0], [1.0])
    qp = nlp.convexify(np.array([1.5]), 1.0).qp
    assert (qp.l.tolist(), qp.u.tolist()) == ([0.5], [1.0])


def test_second_order_correction() -> None:
    # on the unit circle a tangent step of 0.1 leaves by 0.01
    circle = Functions(
        lambda x: float(x[0]),
        lambda _x: np.array([1.0, 0.0]),
        lambda x: np.array([x @ x - 1]),
        lambda x: 2 * x[None],
    )
    nlp = SmoothNLP(circle, 2)
    x, x_new = np.array([1.0, 0.0]), np.array([1.0, 0.1])
    corrected = nlp.corrected(x, x_new)
    assert corrected == pytest.approx([0.995, 0.1])
    assert nlp.measure(corrected).violation < 1e-4
    assert SmoothNLP(LINE, 1).corrected(np.zeros(1), np.ones(1)).tolist() == [1.0]


def test_a_step_that_the_maratos_effect_would_reject_is_corrected(backend_name: str) -> None:
    """Minimise 2 (x'x - 1) - x0 on the unit circle (Nocedal & Wright, example 15.4)."""
    functions = Functions(
        lambda x: float(2 * (x @ x - 1) - x[0]),
        lambda x: 4 * x - np.array([1.0, 0.0]),
        lambda x: np.array([x @ x - 1]),
        lambda x: 2 * x[None],
        hessian=lambda _x, _eq, _ineq: np.eye(2),
    )
    start = np.array([np.cos(0.5), np.sin(0.5)])
    nlp = SmoothNLP(functions, 2, weight=2.0)  # the multiplier is 1.5
    model = nlp.convexify(start, 10.0)
    backend = make_backend(backend_name)
    backend.setup(model.qp, Options(tolerance=1e-6))
    solution = backend.solve().x
    before = nlp.measure(start).merit(model.weight)
    # the full step halves the distance to the solution and yet raises objective and violation
    assert nlp.measure(start + solution[:2]).merit(model.weight) > before
    assert nlp.measure(model.recover(solution)).merit(model.weight) < before


def test_it_hears_of_steps() -> None:
    assert isinstance(SmoothNLP(LINE, 1), StepObserver)


def test_a_jacobian_without_its_function() -> None:
    with pytest.raises(ValueError, match="equality_jacobian belong together"):
        Functions(LINE.objective, LINE.gradient, equalities=lambda x: x)
    with pytest.raises(ValueError, match="inequality_jacobian belong together"):
        Functions(LINE.objective, LINE.gradient, inequality_jacobian=lambda x: x)


@pytest.mark.parametrize("weight", [0.0, -1.0, np.nan, np.inf])
def test_bad_weight(weight: float) -> None:
    with pytest.raises(ValueError, match="weight must be positive"):
        SmoothNLP(LINE, 1, weight=weight)


@pytest.mark.parametrize("lower", [np.array([2.0]), np.array([np.nan]), np.zeros(2)])
def test_bad_bounds(lower: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"lower <= upper must be \(1,\)"):
        SmoothNLP(LINE, 1, lower, np.array([1.0]))
