"""The stop-watch of the benchmark: judging costs nobody anything, and everyone is stopped by the same rule."""

from __future__ import annotations

import time

import numpy as np
import pytest
from bench_missions import far_sighted_mission, small_mission

from mpc_cover.studies import watch as watch_module
from mpc_cover.studies.case import make_case, start_from
from mpc_cover.studies.watch import Sighting, Watch


class FakeClock:
    """A clock that a test moves; judging takes ten seconds on it."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def timed(monkeypatch):
    case, clock, told = make_case(small_mission()), FakeClock(), []
    honest = watch_module.judge

    def slow(case, x):
        clock.now += 10.0
        return honest(case, x)

    monkeypatch.setattr(watch_module, "judge", slow)
    return case, clock, told, Watch(case, 5.0, told.append, clock)


def test_setting_up_is_told_apart_and_judging_is_not_counted(timed):
    case, clock, told, watch = timed
    clock.now += 3.0
    x = start_from(case, "rest")
    watch.begin(x)
    clock.now += 1.0
    assert not watch.see(x)
    clock.now += 2.0
    answer = watch.answer(x, 7, "done")
    assert told[0] == pytest.approx(3.0)
    assert [sighting.time_s for sighting in told[1:]] == pytest.approx([0.0, 1.0, 3.0])
    assert answer.time_s == pytest.approx(3.0)
    assert (answer.iterations, answer.status) == (7, "done")


def test_it_is_enough_when_the_time_is_up(timed):
    case, clock, _, watch = timed
    watch.begin()
    clock.now += 4.9
    assert not watch.see(start_from(case, "rest"))
    clock.now += 0.2
    assert watch.enough
    assert watch.see(start_from(case, "rest"))
    assert not watch.complete


def test_it_is_enough_when_everything_is_covered():
    case, told = make_case(far_sighted_mission()), []
    watch = Watch(case, 1000.0, told.append)
    watch.begin()
    assert watch.see(start_from(case, "rest"))
    assert watch.complete
    assert isinstance(told[-1], Sighting)


def test_what_is_handed_over_is_not_changed_by_what_follows():
    case, told = make_case(small_mission()), []
    watch, x = Watch(case, 1000.0, told.append), start_from(case, "rest")
    watch.begin(x)
    x += 1.0
    assert np.array_equal(told[-1].x, start_from(case, "rest"))


def test_a_deadline_is_what_is_left_on_the_planners_own_clock():
    case, clock = make_case(small_mission()), FakeClock()
    watch = Watch(case, 1e6, lambda _: None, clock)
    watch.begin()
    clock.now += 4e5
    assert 5e5 < watch.budget.left_s < 7e5


def test_processor_time_has_no_deadline_on_the_wall():
    """Beside other processes a minute of the wall is a few seconds of the processor."""
    watch = Watch(make_case(small_mission()), 60.0, lambda _: None, time.process_time)
    watch.begin()
    assert watch.budget.deadline is None
