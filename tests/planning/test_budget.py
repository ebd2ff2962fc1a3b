"""A bound on the work of a plan: kept, and the same every time, whatever the machine is busy with."""

from __future__ import annotations

import time

import numpy as np
import pytest

from mpc_cover.mission.load import load_mission
from mpc_cover.planning.budget import Effort, Meter, late, part_of
from mpc_cover.planning.planner import Planner
from mpc_cover.planning.task import Task


def test_an_effort_is_late_when_its_meter_says_so_and_never_by_the_clock():
    meter = Meter(1.0)
    effort = Effort(meter, 3.0)
    half = part_of(effort, 0.5)
    assert not late(effort)
    assert effort > time.perf_counter() + 1e9
    meter.spent_s = 2.0
    assert late(half)
    assert not late(effort)
    meter.spent_s = 3.0
    assert late(effort)


def task(looked_at=200):
    mission = load_mission("box-3")
    weight = np.where(np.arange(mission.field.size) < looked_at, 1.0, 0.0)[None]
    fleet = mission.fleet
    return Task(fleet, mission.field.cell, weight, fleet.start, np.zeros_like(fleet.start), 0.0, 0.5)


@pytest.mark.parametrize("backend", ["piqp", "clarabel", "osqp"])
def test_a_plan_within_an_effort_is_the_same_again_and_keeps_to_it(backend):
    planner, other = Planner(backend), Planner(backend)
    first = planner.whole(task(), None, 0.3)
    again = other.whole(task(), None, 0.3)
    assert first.feasible
    np.testing.assert_array_equal(first.plan.velocity, again.plan.velocity)
    assert 0.0 < planner._meter.spent_s <= 0.3 + 0.3  # the stage at hand is finished
    assert planner._meter.spent_s == other._meter.spent_s


def test_more_effort_buys_a_plan_that_is_no_worse():
    little, much = Planner("piqp"), Planner("piqp")
    first, second = little.whole(task(), None, 0.05), much.whole(task(), None, 3.0)
    assert little._meter.spent_s < much._meter.spent_s
    assert second.rank <= first.rank
