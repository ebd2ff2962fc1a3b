"""Where a control step's time goes: exclusive times, nothing forgotten, nothing left behind."""

from __future__ import annotations

import pytest
from bench_missions import small_mission

from mpc_cover.planning import coverage_nlp as problem
from mpc_cover.studies.patching import patched
from mpc_cover.studies.step_profile import PLACES, Stopwatch, profile_steps


class Clock:
    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now

    def work(self, seconds):
        self.now += seconds


def test_time_counts_where_it_is_spent():
    clock = Clock()
    watch = Stopwatch(clock)
    inner = watch.timed("inner", clock.work)

    def outer_work():
        clock.work(1.0)
        inner(2.0)
        inner(4.0)
        return "result"

    outer = watch.timed("outer", outer_work)
    assert outer() == "result"
    inner(8.0)
    assert watch.spent == {"inner": 14.0, "outer": 1.0}
    assert watch.reset() == {"inner": 14.0, "outer": 1.0}
    assert not watch.spent


def test_an_exception_is_timed_and_passed_on():
    clock = Clock()
    watch = Stopwatch(clock)

    def fail():
        clock.work(3.0)
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        watch.timed("failing", fail)()
    assert watch.spent == {"failing": 3.0}


def test_a_flight_accounts_for_all_its_time():
    before, told = problem.build_subproblem, []
    parts = profile_steps(small_mission(), "piqp", told.append)
    assert set(parts) == {*PLACES, "the rest", "step"} - {"descents"}  # which only native has
    shares = {name: share for name, (_, _, share) in parts.items()}
    assert shares.pop("step") == pytest.approx(1.0)
    assert sum(shares.values()) == pytest.approx(1.0)
    assert all(share > 0.0 for share in shares.values())
    assert all(0.0 <= median <= high for median, high, _ in parts.values())
    assert problem.build_subproblem is before
    assert told[-1] == 1.0


def test_what_has_moved_is_missed():
    with pytest.raises(AttributeError, match="no_such_name"), patched(problem, "no_such_name", None):
        pass
