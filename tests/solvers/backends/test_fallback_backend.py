"""Falling from one back-end to the next: by size, by cones, after a breakdown; each QP to each at most once."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest
import scipy.sparse as sp
from hock_schittkowski import BY_NUMBER
from qp_strategies import qp_of
from solver_doubles import FakeClock, ScriptedBackend, raw

from solvers import sqp
from solvers.backends.fallback import ORDER, FallbackBackend, with_fallbacks
from solvers.backends.options import Options
from solvers.backends.registry import BACKENDS, UnknownBackendError
from solvers.outcome import Outcome
from solvers.qp import QP, InvalidQPError, SecondOrderCones
from solvers.status import Status

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solvers.backends.base import Backend

BROKEN = raw([np.nan], [], Status.NUMERICAL_ERROR)
ONE = qp_of([[1.0]], [-3.0], [], [], [])


def limited(monkeypatch: pytest.MonkeyPatch, **most: int) -> None:
    """Give back-ends other limits on the number of variables."""
    for name, variables in most.items():
        able = replace(BACKENDS[name].capabilities, variables_max=variables)
        monkeypatch.setattr(BACKENDS[name], "capabilities", able)


def shrinking(n: int) -> QP:
    """Return the QP whose solution is -1 in each of n variables, by bounds that are active."""
    return QP(sp.csc_array(np.eye(n)), 2.0 * np.ones(n), sp.csc_array(np.eye(n)), -np.ones(n), np.ones(n))


def chain(*members: Backend, clock: FakeClock | None = None) -> FallbackBackend:
    return FallbackBackend([lambda one=one: one for one in members], clock or FakeClock())


class Other(ScriptedBackend):
    """A second scripted back-end, of lower accuracy."""

    name = "other"
    capabilities = replace(ScriptedBackend.capabilities, accurate=1e-4, entry_iteration_s=3e-8)


@pytest.mark.parametrize("first", ORDER)
@pytest.mark.parametrize(("excess", "solver"), [((0, 0, 0), 0), ((1, 0, 0), 1), ((1, 1, 0), 2)])
def test_a_qp_goes_to_the_first_in_order_that_bears_it(
    first: str, excess: Sequence[int], solver: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = [first, *(name for name in ORDER if name != first)]
    limited(monkeypatch, **{name: 7 - over for name, over in zip(names, excess, strict=True)})
    backend = with_fallbacks(first)
    backend.load(shrinking(7))
    found = backend.solve()
    assert found.backend == names[solver]
    assert found.x == pytest.approx(-np.ones(7), abs=1e-3)
    assert backend.answered == {names[solver]: 1}
    assert backend.name == first
    backend.load(shrinking(6))  # which all of them bear
    assert backend.solve().backend == first


def test_a_qp_that_nobody_bears_is_refused_with_all_limits_and_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    limited(monkeypatch, piqp=4, clarabel=5, osqp=6)
    backend = with_fallbacks("piqp")
    backend.setup(shrinking(3))
    for take in (backend.setup, backend.load):
        with pytest.raises(
            InvalidQPError, match=r"7 variables are more than any .* piqp 4, clarabel 5, osqp 6 at most"
        ):
            take(shrinking(7))
    assert backend.solve().x == pytest.approx(-np.ones(3), abs=1e-3)


@pytest.mark.parametrize("first", ORDER)
def test_cones_go_to_those_that_have_them(first: str, monkeypatch: pytest.MonkeyPatch) -> None:
    disc = SecondOrderCones(sp.csc_array(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])), np.array([1.0, 0, 0]), (3,))
    backend = with_fallbacks(first)
    backend.setup(replace(qp_of(np.eye(2), [-3, -4], [], [], []), cones=disc))
    found = backend.solve()
    assert found.backend == "clarabel"
    assert found.x == pytest.approx([0.6, 0.8], abs=1e-4)
    limited(monkeypatch, clarabel=1)
    with pytest.raises(InvalidQPError, match="some have no cones"):
        with_fallbacks(first).setup(replace(qp_of(np.eye(2), [-3, -4], [], [], []), cones=disc))


@pytest.mark.parametrize("failure", [BROKEN, RuntimeError("boom"), raw([0.0], [], Status.UNKNOWN)])
def test_a_breakdown_is_followed_by_the_next_which_starts_where_it_was_told_to(failure: object) -> None:
    one, two = ScriptedBackend(failure), Other(raw([3.0], []))
    backend = chain(one, two)
    backend.setup(ONE, Options(tolerance=1e-9))
    backend.warm_start(np.array([2.0]))
    found = backend.solve()
    assert found.status is Status.SOLVED
    assert found.x == pytest.approx([3.0])
    assert two.calls == ["setup", "warm_start", "solve"]
    assert found.detail.startswith("SOLVED (scripted: ")
    assert backend.answered == {"other": 1}


def test_the_next_qp_begins_with_the_first_again_with_its_own_data() -> None:
    one, two = ScriptedBackend(BROKEN, raw([4.0], [])), Other(raw([3.0], []))
    backend = chain(one, two)
    backend.setup(ONE)
    backend.solve()
    backend.update(q=np.array([-4.0]))
    assert backend.solve().backend == "scripted"
    assert backend.qp.q == pytest.approx([-4.0])
    assert backend.answered == {"other": 1, "scripted": 1}


def test_answers_that_say_something_of_the_qp_are_final() -> None:
    for status in (Status.PRIMAL_INFEASIBLE, Status.TIME_LIMIT, Status.MAX_ITERATIONS, Status.INACCURATE):
        backend = chain(ScriptedBackend(raw([0.0], [], status)), Other())
        backend.setup(ONE)
        assert backend.solve().backend == "scripted"


def test_where_all_break_down_each_is_asked_once_and_the_answer_says_so() -> None:
    backend = chain(ScriptedBackend(BROKEN), Other(BROKEN))
    backend.setup(ONE)
    found = backend.solve()
    assert found.status is Status.NUMERICAL_ERROR
    assert backend.answered == {"none": 1}


def test_all_attempts_share_the_time_limit_and_their_work_is_added() -> None:
    clock = FakeClock()

    class Slow(ScriptedBackend):
        """Takes 2 s."""

        def _solve(self, left_s: float | None) -> object:
            clock.pass_s(2.0)
            return super()._solve(left_s)

    one, two = Slow(BROKEN, BROKEN, clock=clock), Other(raw([3.0], []), clock=clock)
    backend = chain(one, two, clock=clock)
    backend.setup(ONE)
    found = backend.solve(5.0)
    assert two.limits == [pytest.approx(3.0)]
    assert found.work_per_entry_s == pytest.approx(1e-8 + 3e-8)
    assert found.solve_time_s == pytest.approx(2.0)
    backend.update(q=np.array([-3.0]))
    assert backend.solve(1.0).status is Status.NUMERICAL_ERROR  # no time is left for the other one
    assert two.calls == ["setup", "solve"]


def test_an_sqp_says_that_its_qp_is_too_large(monkeypatch: pytest.MonkeyPatch) -> None:
    limited(monkeypatch, piqp=1, clarabel=1, osqp=1)
    problem = BY_NUMBER[71]
    found = sqp.solve(problem.nlp(), problem.x0, cast("Backend", with_fallbacks("piqp")))
    assert found.outcome is Outcome.SUBPROBLEM_FAILED
    assert "more than any back-end" in found.detail


def test_only_the_first_is_made_until_another_is_needed() -> None:
    backend = FallbackBackend([lambda: ScriptedBackend(raw([3.0], [])), lambda: pytest.fail("made")], FakeClock())
    backend.setup(ONE)
    assert backend.solve().ok


def test_unknown_names_are_refused() -> None:
    with pytest.raises(UnknownBackendError, match="gurobi"):
        with_fallbacks("gurobi")
