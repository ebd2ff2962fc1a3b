"""What all back-ends must do alike: solutions, updates, refusals, limits, silence."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from qp_strategies import convex_qps, pairs_of_qps, qp_of
from solver_accuracy import CLOSE, TIGHT

from solvers.backends.base import BackendStateError, Options
from solvers.backends.registry import BACKENDS, make_backend
from solvers.qp import QP, InvalidQPError
from solvers.status import Status

if TYPE_CHECKING:
    from solver_doubles import FakeClock

    from solvers.backends.base import Backend

INF = np.inf
EYE = np.eye(2)
NAMES = list(BACKENDS)

# name: problem, x, y
ANALYTIC = {
    "unconstrained": (qp_of(EYE, [-3, -4], [], [], []), [3, 4], []),
    "off-diagonal": (qp_of([[2, 1], [1, 2]], [-3, -3], [], [], []), [1, 1], []),
    "upper": (qp_of(EYE, [-3, -4], EYE, [-INF, -INF], [1, INF]), [1, 4], [2, 0]),
    "lower": (qp_of(EYE, [-3, -4], EYE, [5, -INF], [INF, INF]), [5, 4], [-2, 0]),
    "both sides": (qp_of(EYE, [-3, 4], EYE, [-1, -1], [1, 1]), [1, -1], [2, -3]),
    "equality": (qp_of(EYE, [0, 0], [[1, 1]], [2], [2]), [1, 1], [-1]),
    "equality and bound": (qp_of(EYE, [0, 0], [[1, 1], [1, 0]], [2, -INF], [2, 0.5]), [0.5, 1.5], [-1.5, 1]),
    "free row": (qp_of(EYE, [-3, -4], EYE, [-INF, -INF], [INF, 2]), [3, 2], [0, 2]),
    "zero row": (qp_of(EYE, [-3, -4], [[0, 0], [0, 1]], [-1, -INF], [1, 2]), [3, 2], [0, 2]),
    "linear": (qp_of(0 * EYE, [1, 2], [[1, 0], [0, 1], [1, 1]], [0, 0, 1], [INF, INF, INF]), [1, 0], [0, -1, -1]),
    "one variable": (qp_of([[2]], [-2], [[1]], [-INF], [0.5]), [0.5], [1]),
}


@pytest.mark.parametrize("case", ANALYTIC)
def test_analytic_solutions(backend: Backend, tight: Options, close: float, case: str) -> None:
    qp, x, y = ANALYTIC[case]
    backend.setup(qp, tight)
    found = backend.solve()
    assert found.status is Status.SOLVED
    assert found.ok
    assert found.x == pytest.approx(x, abs=close)
    assert found.y == pytest.approx(y, abs=close)
    assert found.residuals.within(tight.acceptance)
    assert found.detail


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=40)
@given(qp=convex_qps())
def test_random_problems_meet_the_kkt_conditions(name: str, qp: QP) -> None:
    backend = make_backend(name)
    backend.setup(qp, TIGHT[name])
    assert backend.solve().ok


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=40)
@given(pair=pairs_of_qps())
def test_updated_solve_equals_fresh_solve(name: str, pair: tuple[QP, QP]) -> None:
    first, second = pair
    updated, fresh = make_backend(name), make_backend(name)
    updated.setup(first, TIGHT[name])
    updated.solve()
    updated.update(P=second.P.data, q=second.q, A=second.A.data, l=second.l, u=second.u)
    fresh.setup(second, TIGHT[name])
    found, wanted = updated.solve(), fresh.solve()
    assert found.ok
    assert wanted.ok
    # strictly convex: the solution is unique
    assert found.x == pytest.approx(wanted.x, abs=10 * CLOSE[name])


@pytest.mark.parametrize("field", ["P", "q", "A", "l", "u"])
def test_each_field_alone_is_updated(backend: Backend, tight: Options, close: float, field: str) -> None:
    old = qp_of([[2, 1], [1, 2]], [-6, -6], EYE, [-5, -5], [1, 1])
    new = {
        "P": np.array([8.0, 0.5, 8.0]),
        "q": np.array([-1.0, -1.0]),
        "A": np.array([2.0, 4.0]),
        "l": np.array([0.5, 1.0]),
        "u": np.array([0.5, 0.75]),
    }[field]
    matrices = {"P": old.P, "A": old.A}
    if field in matrices:
        changed = replace(old, **{field: sp.csc_array((new, matrices[field].indices, matrices[field].indptr))})
    else:
        changed = replace(old, **{field: new})
    fresh = type(backend)()
    fresh.setup(changed, tight)
    backend.setup(old, tight)
    before = backend.solve()
    backend.update(**{field: new})
    after, wanted = backend.solve(), fresh.solve()
    assert after.ok
    assert after.x == pytest.approx(wanted.x, abs=close)
    if field != "l":
        assert before.x != pytest.approx(wanted.x, abs=100 * close)


def test_entries_that_were_zero_stay_in_the_pattern(backend: Backend, tight: Options, close: float) -> None:
    P = sp.csc_array((np.array([1.0, 0.0, 1.0]), np.array([0, 0, 1]), np.array([0, 1, 3])), shape=(2, 2))
    A = sp.csc_array((np.zeros(4), np.array([0, 1, 0, 1]), np.array([0, 2, 4])), shape=(2, 2))
    backend.setup(QP(P, np.array([-3.0, -3.0]), A, np.array([-9.0, 1.0 - 1.0]), np.ones(2)), tight)
    assert backend.solve().x == pytest.approx([3, 3], abs=close)
    backend.update(P=np.array([1.0, 0.5, 1.0]), A=np.array([1.0, 0.0, 1.0, 1.0]))
    # by symmetry on the line where the sum is 1
    assert backend.solve().x == pytest.approx([0.5, 0.5], abs=close)


def test_rows_may_change_their_kind(backend: Backend, tight: Options, close: float) -> None:
    backend.setup(qp_of(EYE, [-3, -4], EYE, [-INF, -7], [1, INF]), tight)
    bounds_and_x = [
        (([2, 3], [INF, 3]), [3, 3]),
        (([-INF, -INF], [INF, INF]), [3, 4]),
        (([1, -INF], [1, 2]), [1, 2]),
        (([5, -INF], [INF, -1]), [5, -1]),
        (([-INF, -7], [1, INF]), [1, 4]),
    ]
    for (lower, upper), x in bounds_and_x:
        backend.update(l=np.array(lower, dtype=float), u=np.array(upper, dtype=float))
        found = backend.solve()
        assert found.ok
        assert found.x == pytest.approx(x, abs=close)


def test_both_bounds_may_cross_the_old_ones(backend: Backend, tight: Options, close: float) -> None:
    backend.setup(qp_of([[1]], [0], [[1]], [1], [2]), tight)
    backend.update(l=np.array([5.0]), u=np.array([6.0]))
    assert backend.solve().x == pytest.approx([5], abs=close)
    backend.update(l=np.array([-6.0]), u=np.array([-5.0]))
    assert backend.solve().x == pytest.approx([-5], abs=close)


def test_infeasible_and_back(backend: Backend, tight: Options, close: float) -> None:
    backend.setup(qp_of(EYE, [-3, -4], [[1, 0], [1, 0]], [-INF, 2], [1, INF]), tight)
    found = backend.solve()
    assert found.status is Status.PRIMAL_INFEASIBLE
    assert not found.ok
    backend.update(u=np.array([2.5, INF]))
    found = backend.solve()
    assert found.ok
    assert found.x == pytest.approx([2.5, 4], abs=close)


def test_unbounded(backend: Backend, tight: Options) -> None:
    backend.setup(qp_of(np.zeros((2, 2)), [-1, 0], EYE, [0, 0], [INF, 1]), tight)
    found = backend.solve()
    assert found.status is Status.DUAL_INFEASIBLE
    assert not found.ok


def test_crossed_bounds_are_refused_and_nothing_changes(backend: Backend, tight: Options, close: float) -> None:
    backend.setup(qp_of(EYE, [-3, -4], EYE, [-1, -1], [1, 1]), tight)
    with pytest.raises(InvalidQPError, match=r"row 1: l\[1\] = 2.0 is above u\[1\] = 1.0"):
        backend.update(q=np.zeros(2), l=np.array([-1.0, 2.0]))
    assert backend.qp.q.tolist() == [-3, -4]
    assert backend.solve().x == pytest.approx([1, 1], abs=close)


@pytest.mark.parametrize("field", ["P", "q", "A", "l", "u"])
def test_nan_is_refused_and_clean_data_solve(backend: Backend, tight: Options, close: float, field: str) -> None:
    backend.setup(qp_of(EYE, [-3, -4], EYE, [-1, -1], [1, 1]), tight)
    with pytest.raises(InvalidQPError, match=rf"{field}\[1\] = nan"):
        backend.update(**{field: np.array([0.0, np.nan])})
    found = backend.solve()
    assert found.ok
    assert found.x == pytest.approx([1, 1], abs=close)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"q": np.zeros(3)}, r"q: needs float64 \(2,\)"),
        ({"P": np.zeros(3)}, r"P: needs float64 \(2,\)"),
        ({"A": np.zeros((2, 1))}, r"A: needs float64 \(2,\)"),
        ({"l": np.zeros(1)}, r"l: needs float64 \(2,\)"),
        ({"u": np.array([1, 1])}, r"u: needs float64 \(2,\), got int64"),
        ({"P": np.array([1.0, -1.0])}, "P: not positive semi-definite"),
        ({"l": np.array([INF, 0.0])}, r"l\[0\] = inf"),
    ],
)
def test_misfits_are_refused(backend: Backend, change: dict, message: str) -> None:
    backend.setup(qp_of(EYE, [-3, -4], EYE, [-1, -1], [1, 1]))
    with pytest.raises(InvalidQPError, match=message):
        backend.update(**change)


def test_a_misspelt_field_is_an_error(backend: Backend) -> None:
    backend.setup(qp_of(EYE, [-3, -4], EYE, [-1, -1], [1, 1]))
    with pytest.raises(TypeError):
        backend.update(Ax=np.ones(2))  # type: ignore[call-arg]


def test_values_are_copied(backend: Backend, tight: Options, close: float) -> None:
    qp = qp_of(EYE, [-3, -4], EYE, [-1, -1], [1, 1])
    backend.setup(qp, tight)
    q = np.array([3.0, 4.0])
    backend.update(q=q, A=np.array([2.0, 2.0]))
    q[:] = 0.0
    assert backend.solve().x == pytest.approx([-0.5, -0.5], abs=close)
    assert qp.A.data.tolist() == [1, 1]
    assert qp.q.tolist() == [-3, -4]


def test_warm_start_is_checked(backend: Backend, tight: Options, close: float) -> None:
    backend.setup(qp_of(EYE, [-3, -4], EYE, [-1, -1], [1, 1]), tight)
    for x, y in ((np.array([np.nan, 0.0]), None), (np.zeros(3), None), (np.zeros(2), np.full(2, INF))):
        with pytest.raises(InvalidQPError):
            backend.warm_start(x, y)
    backend.warm_start(np.array([1e6, -1e6]), np.array([1e3, 1e3]))
    assert backend.solve().x == pytest.approx([1, 1], abs=close)


def test_nothing_works_before_setup(backend: Backend) -> None:
    for call in (backend.solve, backend.update, lambda: backend.warm_start(np.zeros(1)), lambda: backend.qp):
        with pytest.raises(BackendStateError, match="call setup"):
            call()


def test_invalid_problem_leaves_the_old_one(backend: Backend, tight: Options, close: float) -> None:
    good = qp_of(EYE, [-3, -4], EYE, [-1, -1], [1, 1])
    backend.setup(good, tight)
    with pytest.raises(InvalidQPError):
        backend.setup(replace(good, q=np.array([np.nan, 0.0])))
    assert backend.solve().x == pytest.approx([1, 1], abs=close)


def test_set_up_counts_against_the_time_limit(backend_name: str, clock: FakeClock) -> None:
    backend = make_backend(backend_name, clock)
    native_setup = backend._setup

    def slow(qp: QP, options: Options) -> None:
        native_setup(qp, options)
        clock.pass_s(0.9)

    backend._setup = slow  # type: ignore[method-assign]
    backend.setup(qp_of(EYE, [-3, -4], EYE, [-1, -1], [1, 1]))
    start = np.array([0.25, 0.5])
    backend.warm_start(start)
    found = backend.solve(time_limit_s=0.05)
    assert found.status is Status.TIME_LIMIT
    assert found.x.tolist() == start.tolist()
    assert found.setup_time_s == pytest.approx(0.9)
    # the set-up has been paid for
    found = backend.solve(time_limit_s=0.05)
    assert found.ok
    assert found.setup_time_s == 0.0


@pytest.mark.parametrize("limit", [0.0, -1.0, np.nan])
def test_no_time_at_all(backend: Backend, limit: float) -> None:
    backend.setup(qp_of(EYE, [-3, -4], EYE, [-1, -1], [1, 1]))
    found = backend.solve(time_limit_s=limit)
    assert found.status is Status.TIME_LIMIT
    assert found.x.tolist() == [0, 0]
    assert backend.solve(time_limit_s=10.0).ok


def test_iteration_limit(backend: Backend) -> None:
    rng = np.random.default_rng(0)
    A = rng.normal(size=(30, 20))
    qp = qp_of(np.eye(20), 10 * rng.normal(size=20), A, np.full(30, -1.0), np.full(30, 1.0))
    backend.setup(qp, Options(tolerance=1e-9, max_iterations=2))
    found = backend.solve()
    assert found.status is Status.MAX_ITERATIONS
    assert found.iterations == 2


def test_load_updates_in_place_where_it_can(backend: Backend, tight: Options, close: float) -> None:
    qp = qp_of(EYE, [-3, -4], EYE, [-1, -1], [1, 1])
    assert backend.load(qp, tight)
    assert backend.solve().setup_time_s > 0.0
    assert not backend.load(replace(qp, q=np.array([-0.5, -0.5])), tight)
    found = backend.solve()
    assert found.x == pytest.approx([0.5, 0.5], abs=close)
    assert found.setup_time_s == 0.0
    assert backend.load(qp, replace(tight, max_iterations=7))
    assert backend.load(qp_of(EYE, [-3, -4], [[1, 1]], [-1], [1]), tight)
    assert backend.solve().x == pytest.approx([0, 1], abs=close)


def test_same_input_same_output(backend_name: str) -> None:
    rng = np.random.default_rng(1)
    qp = qp_of(np.eye(8), rng.normal(size=8), rng.normal(size=(12, 8)), np.full(12, -0.3), np.full(12, 0.3))
    runs = []
    for _ in range(2):
        backend = make_backend(backend_name)
        backend.setup(qp)
        first = backend.solve()
        backend.update(q=2.0 * qp.q)
        runs.append((first.x.tolist(), backend.solve().x.tolist()))
    assert runs[0] == runs[1]


def test_nothing_is_printed(backend: Backend, capfd: pytest.CaptureFixture[str]) -> None:
    backend.setup(qp_of([[1, 5], [5, 1]], [-3, -4], EYE, [-1, -INF], [1, INF]))
    backend.solve()
    backend.setup(qp_of(EYE, [-3, -4], EYE, [-1, -INF], [1, INF]))
    backend.solve()
    backend.update(l=np.array([-1.0, 0.0]))
    backend.solve(time_limit_s=1e-9)
    assert capfd.readouterr() == ("", "")
