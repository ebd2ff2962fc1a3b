"""The judgement of native results, and what happens when the native solver breaks down."""

from __future__ import annotations

import numpy as np
import pytest
from qp_strategies import qp_of
from solver_doubles import FakeClock, ScriptedBackend, raw

from solvers.backends.options import Options
from solvers.qp import InvalidQPError, SecondOrderCones
from solvers.residuals import Tolerances
from solvers.status import Status

# minimise x^2 / 2 - 3 x subject to -1 <= x <= 1: x = 1, y = 2
QP_1 = qp_of([[1]], [-3], [[1]], [-1], [1])
RIGHT, WRONG = raw([1.0], [2.0]), raw([1.5], [1.5])


class Panic(BaseException):
    """Like a Rust panic: not an Exception."""


def solved(answer: object, options: Options | None = None) -> tuple[ScriptedBackend, object]:
    backend = ScriptedBackend(answer, RIGHT)  # type: ignore[arg-type]
    backend.setup(QP_1, options)
    return backend, backend.solve()


@pytest.mark.parametrize(
    ("status", "judged"),
    [
        (Status.SOLVED, Status.SOLVED),
        (Status.INACCURATE, Status.SOLVED),
        (Status.MAX_ITERATIONS, Status.SOLVED),
        (Status.TIME_LIMIT, Status.SOLVED),
        (Status.NUMERICAL_ERROR, Status.SOLVED),
        (Status.UNKNOWN, Status.SOLVED),
        (Status.PRIMAL_INFEASIBLE, Status.PRIMAL_INFEASIBLE),
        (Status.DUAL_INFEASIBLE, Status.DUAL_INFEASIBLE),
        (Status.NON_CONVEX, Status.NON_CONVEX),
        (Status.INTERRUPTED, Status.INTERRUPTED),
        (Status.INVALID_DATA, Status.INVALID_DATA),
    ],
)
def test_good_residuals_overrule_all_but_certificates(status: Status, judged: Status) -> None:
    assert solved(raw([1.0], [2.0], status))[1].status is judged


@pytest.mark.parametrize("status", [status for status in Status if status is not Status.SOLVED])
def test_bad_residuals_keep_the_native_word(status: Status) -> None:
    assert solved(raw([1.5], [1.5], status))[1].status is status


def test_solved_with_an_infeasible_x_is_not_solved() -> None:
    _, found = solved(WRONG)
    assert found.status is Status.INACCURATE
    assert not found.ok
    assert found.residuals.primal == pytest.approx(0.5)


def test_the_caller_says_what_is_accurate() -> None:
    assert solved(raw([1.001], [2.0]))[1].status is Status.INACCURATE
    assert solved(raw([1.001], [2.0]), Options(accept=Tolerances(0.01)))[1].ok


@pytest.mark.parametrize("bad", [raw([np.nan], [0.0]), raw([0.0], [np.inf])])
def test_what_is_not_finite_is_a_numerical_error_and_sets_up_anew(bad: object) -> None:
    backend, found = solved(bad)
    assert found.status is Status.NUMERICAL_ERROR
    assert backend.solve().ok
    assert backend.calls == ["setup", "solve", "setup", "solve"]


@pytest.mark.parametrize("error", [ValueError("native"), Panic("native")])
def test_exception_in_solve(error: BaseException) -> None:
    backend = ScriptedBackend(RIGHT, error, RIGHT)
    backend.setup(QP_1)
    backend.solve()
    found = backend.solve()
    assert found.status is Status.NUMERICAL_ERROR
    assert "native" in found.detail
    assert found.x.tolist() == [0.0]  # the warm start is gone
    assert backend.solve().ok
    assert backend.calls == ["setup", "solve", "solve", "setup", "solve"]


def test_exception_in_setup_is_reported_by_solve_and_tried_again() -> None:
    backend = ScriptedBackend(RIGHT, setups=[ValueError("first"), ValueError("second"), None])
    backend.setup(QP_1)
    found = backend.solve()
    assert found.status is Status.NUMERICAL_ERROR
    assert "second" in found.detail
    assert backend.solve().ok


def test_exception_in_update_sets_up_anew() -> None:
    backend = ScriptedBackend(RIGHT)
    backend.setup(QP_1)

    def broken(_qp: object, _changed: object) -> bool:
        raise ValueError("native")

    backend._update = broken  # type: ignore[method-assign]
    backend.update(q=np.array([-3.0]))
    assert backend.solve().ok
    assert backend.calls == ["setup", "setup", "solve"]


def test_interrupts_pass() -> None:
    backend = ScriptedBackend(KeyboardInterrupt())
    backend.setup(QP_1)
    with pytest.raises(KeyboardInterrupt):
        backend.solve()


def test_warm_start_survives_a_new_set_up() -> None:
    backend = ScriptedBackend(RIGHT)
    backend.setup(QP_1)
    backend._update = lambda _qp, _changed: False  # type: ignore[method-assign]
    backend.warm_start(np.array([0.5]))
    backend.update(l=np.array([-np.inf]))
    assert backend.solve().ok
    assert backend.calls == ["setup", "warm_start", "setup", "warm_start", "solve"]


def test_exception_in_warm_start_is_contained() -> None:
    backend = ScriptedBackend(RIGHT)
    backend.setup(QP_1)

    def broken(_x: object, _y: object) -> bool:
        raise ValueError("native")

    backend._warm_start = broken  # type: ignore[method-assign]
    backend.warm_start(np.array([0.5]))
    assert backend.solve().status is Status.NUMERICAL_ERROR


def test_the_last_solution_is_the_next_start() -> None:
    backend = ScriptedBackend(raw([1.5], [1.5]), raw([7.0], [7.0], Status.PRIMAL_INFEASIBLE))
    backend.setup(QP_1)
    backend.solve()
    backend.solve()
    found = backend.solve(time_limit_s=0.0)
    assert found.x.tolist() == [1.5]
    assert found.y.tolist() == [1.5]


def test_only_the_given_fields_are_handed_on() -> None:
    backend = ScriptedBackend()
    backend.setup(QP_1)
    backend.update()
    backend.update(q=np.zeros(1), u=np.ones(1))
    assert backend.calls == ["setup", "update q u"]


def test_the_limit_that_is_left() -> None:
    clock = FakeClock()
    backend = ScriptedBackend(RIGHT, RIGHT, RIGHT, clock=clock)
    backend.setup(QP_1)
    clock.pass_s(0.25)
    backend.solve(time_limit_s=1.0)
    clock.pass_s(10.0)
    backend.solve(time_limit_s=1.0)
    backend.solve()
    assert backend.limits == [0.75, 1.0, None]


def test_times_are_those_of_this_solve_alone() -> None:
    backend = ScriptedBackend(RIGHT, RIGHT, clock=FakeClock(step_s=1.0))
    backend.setup(QP_1)
    first, second = backend.solve(), backend.solve()
    assert first.setup_time_s > 0.0
    assert second.setup_time_s == 0.0
    assert first.solve_time_s == second.solve_time_s > 0.0


def test_cones_are_refused_where_there_are_none() -> None:
    cones = SecondOrderCones(QP_1.A, np.ones(1), (1,))
    with pytest.raises(InvalidQPError, match="scripted has no second-order cones"):
        ScriptedBackend().setup(qp_of([[1]], [-3], [[1]], [-1], [1], cones=cones))


@pytest.mark.parametrize(
    "bad", [{"tolerance": 0.0}, {"tolerance": np.nan}, {"tolerance": np.inf}, {"max_iterations": 0}]
)
def test_options_that_mean_nothing(bad: dict) -> None:
    with pytest.raises(ValueError, match="must be"):
        Options(**bad)
