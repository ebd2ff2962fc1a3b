"""Every peer lowers J from a guess, shows its iterates, and stops when it is told to."""

from __future__ import annotations

import numpy as np
import pytest
from bench_missions import far_sighted_mission, small_mission

from mpc_cover.errors import UserError
from mpc_cover.planning.budget import Budget
from mpc_cover.planning.multistart import Search
from mpc_cover.planning.planner import Planner
from mpc_cover.studies.case import Guess, make_case, start_from
from mpc_cover.studies.peers.registry import PEERS, chosen
from mpc_cover.studies.verdict import judge
from mpc_cover.studies.watch import Sighting, Watch

pytestmark = pytest.mark.filterwarnings("ignore:builtin type:DeprecationWarning")  # SWIG's, on newer Pythons

CASADI = {"ipopt-smooth", "ipopt-hessian", "ipopt-min", "sqpmethod"}


class Hurried:
    """A clock on which every look takes a second."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        self.now += 1.0
        return self.now


def solved(name, mission, guess="boustrophedon", limit=1000.0, clock=None):
    """Return the answer of a peer, what it showed, and the case."""
    if name in CASADI:
        pytest.importorskip("casadi")
    if name == "jax-lbfgs":
        pytest.importorskip("jax")
    case, told = make_case(mission), []
    watch = Watch(case, limit, told.append, *([clock] if clock else []))
    answer = PEERS[name].load()(case, start_from(case, guess), watch)
    return answer, [each for each in told if isinstance(each, Sighting)], case


@pytest.mark.parametrize("name", sorted(set(PEERS) - {"cvxpy"}))
def test_everyone_lowers_the_cost_and_ends_feasible(name):
    clock = None if name.startswith("ours") else Hurried()  # ours keeps to a deadline on the real one
    answer, seen, case = solved(name, small_mission({"duration_s": 3.0}), limit=150.0, clock=clock)
    before = judge(case, start_from(case, "boustrophedon")).cost
    best = min((s for s in seen if s.verdict.holds_sampled), key=lambda s: s.verdict.cost)
    assert best.verdict.cost < 0.7 * before
    assert answer.iterations > 0
    assert answer.status
    assert np.array_equal(seen[-1].x, answer.x)
    times = [s.time_s for s in seen]
    assert times == sorted(times)


@pytest.mark.parametrize("name", sorted(PEERS))
def test_everyone_stops_when_the_time_is_up(name):
    answer, seen, _ = solved(name, small_mission({"duration_s": 3.0}), limit=1.0, clock=Hurried())
    assert len(seen) <= 8
    assert answer.status


@pytest.mark.parametrize("name", ["ours-piqp", "ipopt-smooth", "slsqp", "sqpmethod", "jax-lbfgs", "cvxpy"])
def test_nobody_works_on_when_nothing_is_left(name):
    answer, seen, _ = solved(name, far_sighted_mission(), guess="rest")
    assert seen[0].verdict.complete
    assert len(seen) <= 3
    assert answer.time_s < 1000.0


def test_the_cvxpy_loop_makes_progress_too():
    mission = small_mission({"duration_s": 2.0})
    _, seen, _ = solved("cvxpy", mission, limit=5.0, clock=Hurried())
    assert seen[-1].verdict.cost < seen[0].verdict.cost


def test_an_exception_of_a_callback_comes_out_of_casadi(monkeypatch):
    pytest.importorskip("casadi")
    case = make_case(small_mission())
    watch = Watch(case, 1000.0, lambda _: None)
    monkeypatch.setattr(watch, "see", lambda x: 1 / 0)
    monkeypatch.setattr(watch, "begin", lambda x: None)
    with pytest.raises(ZeroDivisionError):
        PEERS["ipopt-smooth"].load()(case, start_from(case, "rest"), watch)


@pytest.mark.parametrize("guess", Guess)
def test_ours_is_the_planner_itself_from_the_one_guess(guess):
    mission = small_mission({"duration_s": 6.0})
    answer, seen, case = solved("ours-piqp", mission, guess=guess)
    assert seen[-1].verdict.complete
    search, given = Search(rounds=20), {"": seen[0].x}
    plain = Planner("piqp").fixed(case.task, case.ocp.steps, search, Budget.unlimited(), given=given)
    position, velocity = case.ocp.motion(answer.x)
    assert plain.complete
    assert np.array_equal(plain.plan.velocity, velocity)
    assert np.array_equal(plain.plan.position, position)


def test_peers_are_chosen_by_name():
    assert [entry.name for entry in chosen(None)] == list(PEERS)
    assert [entry.name for entry in chosen("slsqp, ours-piqp,slsqp")] == ["slsqp", "ours-piqp"]
    for wrong in ("snopt", "", " , "):
        with pytest.raises(UserError, match="ours-piqp"):
            chosen(wrong)


@pytest.mark.parametrize("guess", Guess)
def test_guesses_end_as_they_must(guess):
    case = make_case(small_mission())
    position, velocity = case.ocp.motion(start_from(case, guess))
    assert position[0] == pytest.approx(case.task.position)
    assert velocity[-1] == pytest.approx(0.0)
