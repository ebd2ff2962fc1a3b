"""What the controller counts on."""

from __future__ import annotations

import pytest
from tiny_mission import TINY

from mpc_cover.control.planning_constraints import PlanningConstraints
from mpc_cover.mission.load import build_mission


def constraints(**disturbance):
    raw = {**TINY, "fleet": {**TINY["fleet"], "communication_range_m": 8.0}, "disturbance": disturbance}
    return PlanningConstraints(build_mission(raw, "tiny"))


def test_range_is_kept_in_reserve_until_it_is_known_who_is_slow():
    known, wary = constraints(), constraints(slow_agents={"a1": 0.5})
    tube = 8.0 - wary._tight.communication_range
    # two periods of 0.5 s and a report of 0.1 s, 0.5 m/s behind
    assert wary.fleet.communication_range == pytest.approx(8.0 - tube - 0.5 * 1.1)
    wary.limit_speed(0, 0.48)
    assert wary.fleet.communication_range == pytest.approx(8.0 - tube)
    assert known.fleet.communication_range == 8.0


def test_agents_that_are_as_fast_as_stated_need_no_reserve():
    assert constraints(slow_agents={"a1": 1.0}).fleet.communication_range == 8.0


def test_most_of_the_range_is_used_all_the_same():
    wary = constraints(slow_agents={"a1": 0.1}, delay_s=0.5)
    assert wary.fleet.communication_range >= 0.75 * wary._tight.communication_range


def test_plans_leave_room_for_the_time_that_it_takes_to_notice_a_death():
    assert constraints().fleet.reaction == pytest.approx(2.0 + 0.1 / 0.5)
    assert constraints(delay_s=0.25).fleet.reaction == pytest.approx(2.0 + 0.35 / 0.5)
