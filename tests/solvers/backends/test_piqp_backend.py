"""PIQP's free rows, and the cap on iterations that stands in for a time limit."""

from __future__ import annotations

import numpy as np
import pytest
from qp_strategies import qp_of
from solver_doubles import FakeClock

from solvers.backends.options import Options
from solvers.backends.piqp_ import MAX_ITERATIONS, PIQPBackend
from solvers.status import Status

EYE, INF = np.eye(2), np.inf
BOX = qp_of(EYE, [-3, -4], EYE, [-1, -1], [1, 1])


def test_a_free_row_gets_its_bound_back(capfd: pytest.CaptureFixture[str]) -> None:
    backend = PIQPBackend()
    backend.setup(qp_of(EYE, [-3, -4], EYE, [-INF, -INF], [1, INF]), Options(tolerance=1e-9))
    assert backend.solve().x == pytest.approx([1, 4], abs=1e-6)
    backend.update(u=np.array([INF, 2.0]))
    found = backend.solve()
    assert found.ok
    assert found.x == pytest.approx([3, 2], abs=1e-6)
    assert found.setup_time_s > 0.0
    assert capfd.readouterr() == ("", "")


def test_changes_within_a_kind_need_no_set_up() -> None:
    backend = PIQPBackend()
    backend.setup(BOX)
    backend.solve()
    backend.update(l=np.array([-2.0, -2.0]), u=np.array([0.5, 0.5]))
    found = backend.solve()
    assert found.x == pytest.approx([0.5, 0.5], abs=1e-5)
    assert found.setup_time_s == 0.0


def test_the_pace_of_one_iteration_is_measured_first() -> None:
    backend = PIQPBackend(FakeClock(step_s=1.0))
    backend.setup(BOX)
    assert backend._iteration_s is None
    found = backend.solve(time_limit_s=1000.0)
    assert found.ok
    assert backend._iteration_s == pytest.approx(1.0 / (found.iterations + 1))
    assert backend._native.settings.max_iter == MAX_ITERATIONS


def test_the_cap_is_what_is_left_over_the_pace() -> None:
    backend = PIQPBackend(FakeClock())
    backend.setup(BOX)
    backend._iteration_s = 0.1
    found = backend.solve(time_limit_s=0.25)
    assert found.status is Status.TIME_LIMIT
    assert found.iterations == 2


def test_no_time_for_one_iteration() -> None:
    backend = PIQPBackend(FakeClock())
    backend.setup(BOX)
    backend.solve()
    backend.update(q=np.array([3.0, 4.0]))
    backend._iteration_s = 0.1
    found = backend.solve(time_limit_s=0.05)
    assert found.status is Status.TIME_LIMIT
    assert found.detail == "no time for an iteration"
    assert found.x == pytest.approx([1, 1], abs=1e-5)  # the last solution


def test_the_first_iteration_may_already_be_too_slow() -> None:
    clock = FakeClock()
    backend = PIQPBackend(clock)
    backend.setup(BOX)
    run = backend._run

    def slow(iterations: int, at_the_limit: Status) -> object:
        clock.pass_s(1.0)
        return run(iterations, at_the_limit)

    backend._run = slow  # type: ignore[method-assign,assignment]
    assert backend.solve(time_limit_s=0.5).status is Status.TIME_LIMIT


def test_the_limit_on_iterations_has_its_own_name() -> None:
    backend = PIQPBackend()
    backend.setup(BOX, Options(tolerance=1e-9, max_iterations=2))
    assert backend.solve().status is Status.MAX_ITERATIONS
    assert backend.solve(time_limit_s=60.0).status is Status.MAX_ITERATIONS


def test_invalid_settings_are_reported() -> None:
    backend = PIQPBackend()
    backend.setup(BOX)
    backend._native.settings.tau = 7.0  # what our options cannot do
    assert backend.solve().status is Status.INVALID_DATA


def test_nan_past_the_guards_is_survived() -> None:
    backend = PIQPBackend()
    backend.setup(BOX)
    backend._native.update(c=np.array([np.nan, 0.0]))
    assert backend.solve().status is Status.NUMERICAL_ERROR
    assert backend.solve().ok
