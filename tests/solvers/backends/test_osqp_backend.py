"""OSQP's own traps."""

from __future__ import annotations

import numpy as np
import pytest
from qp_strategies import qp_of
from solver_doubles import FakeClock

from solvers.backends.options import Options
from solvers.backends.osqp_ import NO_LIMIT_S, OSQPBackend
from solvers.status import Status

EYE = np.eye(2)
BOX = qp_of(EYE, [-3, -4], EYE, [-1, -1], [1, 1])


def hard() -> tuple[OSQPBackend, FakeClock]:
    """A problem of some hundred iterations."""
    clock = FakeClock()
    rng = np.random.default_rng(0)
    A = rng.normal(size=(60, 30)) * 10.0 ** rng.uniform(-2, 2, (60, 1))
    backend = OSQPBackend(clock)
    qp = qp_of(np.diag([1e-3] * 30), rng.normal(size=30), A, np.full(60, -1.0), np.full(60, 1.0))
    backend.setup(qp, Options(tolerance=1e-8, max_iterations=100_000))
    return backend, clock


def test_time_limit_is_kept_and_then_lifted() -> None:
    backend, _ = hard()
    found = backend.solve(time_limit_s=1e-9)
    assert found.status is Status.TIME_LIMIT
    assert found.detail == "OSQP_TIME_LIMIT_REACHED"
    assert backend.solve().ok


def test_what_osqp_counts_beside_the_solve_is_added_to_its_limit() -> None:
    clock = FakeClock(step_s=1.0)
    backend = OSQPBackend(clock)
    backend.setup(BOX)
    # within set-up the clock is looked at twice: 1 s is what OSQP will count again
    assert backend._counted_s == 1.0
    backend.solve(time_limit_s=100.0)
    assert backend._counted_s == 0.0
    backend.update(q=np.zeros(2))
    backend.update(l=np.zeros(2))
    assert backend._counted_s == 2.0
    backend.solve(time_limit_s=100.0)
    assert backend._native_limit_s == 101.0
    assert backend._native.settings.time_limit == 101.0
    backend.solve()
    assert backend._native.settings.time_limit == NO_LIMIT_S


def test_infeasible_x_is_not_a_number_that_looks_like_one() -> None:
    backend = OSQPBackend()
    backend.setup(qp_of(EYE, [0, 0], [[1, 0], [1, 0]], [2, -np.inf], [np.inf, 1]))
    found = backend.solve()
    assert found.status is Status.PRIMAL_INFEASIBLE
    assert np.isnan(found.x).all()
    assert found.residuals.primal == np.inf


def test_a_poisoned_warm_start_is_gone_after_the_next_set_up() -> None:
    backend = OSQPBackend()
    backend.setup(BOX, Options(tolerance=1e-7, max_iterations=50))
    # past the guards: what the base class keeps out
    backend._native.update(q=np.array([np.nan, 0.0]))
    assert backend.solve().status is Status.NUMERICAL_ERROR
    found = backend.solve()
    assert found.ok
    assert found.x == pytest.approx([1, 1], abs=1e-5)


def test_a_non_convex_update_is_noticed_and_survived(capfd: pytest.CaptureFixture[str]) -> None:
    backend = OSQPBackend()
    backend.setup(qp_of([[1, 0.5], [0.5, 1]], [-3, -4], EYE, [-1, -1], [1, 1]))
    backend.update(P=np.array([1.0, 50.0, 1.0]))
    # without the guard OSQP answers "solved" at the saddle point
    found = backend.solve()
    assert found.status is Status.NUMERICAL_ERROR
    assert "non-convex" in found.detail
    backend.update(P=np.array([1.0, 0.0, 1.0]))
    found = backend.solve()
    assert found.ok
    assert found.x == pytest.approx([1, 1], abs=1e-4)
    assert capfd.readouterr() == ("", "")


def test_non_convex_from_the_start() -> None:
    backend = OSQPBackend()
    backend.setup(qp_of([[1, 50], [50, 1]], [-3, -4], EYE, [-1, -1], [1, 1]))
    found = backend.solve()
    assert found.status is Status.NUMERICAL_ERROR
    assert "non-convex" in found.detail


def test_warm_start_spares_iterations() -> None:
    backend, _ = hard()
    first = backend.solve()
    backend.warm_start(np.zeros(30), np.zeros(60))
    cold = backend.solve()
    backend.warm_start(first.x, first.y)
    assert backend.solve().iterations < cold.iterations


def test_the_matrices_of_the_caller_are_left_alone() -> None:
    backend = OSQPBackend()
    qp = qp_of(EYE, [-3, -4], EYE, [-1, -1], [1, 1])
    backend.setup(qp)
    backend.update(P=np.full(2, 7.0), A=np.full(2, 7.0))
    assert qp.P.data.tolist() == qp.A.data.tolist() == [1, 1]
