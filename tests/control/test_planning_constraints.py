"""What the controller counts on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tiny_mission import TINY

from mpc_cover.control.planning_constraints import PlanningConstraints
from mpc_cover.mission.load import build_mission
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.model.tube import tube_of


def disturbed(**disturbance):
    raw = {**TINY, "fleet": {**TINY["fleet"], "communication_range_m": 8.0}, "disturbance": disturbance}
    return build_mission(raw, "tiny")


def constraints(**disturbance):
    return PlanningConstraints(disturbed(**disturbance))


def state(**changes):
    fleet = disturbed().fleet
    return replace(FleetState.nominal(fleet.start, np.zeros_like(fleet.start), 0.0), **changes)


def test_range_is_kept_in_reserve_until_it_is_known_who_is_slow():
    known, wary = constraints(), constraints(slow_agents={"a1": 0.5})
    tube = 2.0 * tube_of(disturbed(slow_agents={"a1": 0.5})).position_m
    # two periods of 0.5 s and a report of 0.1 s, 0.5 m/s behind
    assert wary.fleet.communication_range == pytest.approx(8.0 - tube - 0.5 * 1.1)
    assert wary.update(state(speed_share=np.array([0.48, 1.0])), None)
    assert wary.fleet.communication_range == pytest.approx(8.0 - tube)
    assert wary.fleet.speed_max == pytest.approx([0.48 * (known.fleet.speed_max[0]), known.fleet.speed_max[1]])
    assert known.fleet.communication_range == 8.0


def test_agents_that_are_as_fast_as_stated_need_no_reserve():
    assert constraints(slow_agents={"a1": 1.0}).fleet.communication_range == 8.0


def test_most_of_the_range_is_used_all_the_same():
    mission = disturbed(slow_agents={"a1": 0.1}, delay_s=0.5)
    wary = PlanningConstraints(mission)
    tight = 8.0 - 2.0 * tube_of(mission).position_m
    assert wary.fleet.communication_range >= 0.75 * tight


def test_plans_leave_room_for_the_time_that_it_takes_to_notice_a_death():
    assert constraints().fleet.reaction_periods == pytest.approx(2.0 + 0.1 / 0.5)
    assert constraints(delay_s=0.25).fleet.reaction_periods == pytest.approx(2.0 + 0.35 / 0.5)


def test_an_agent_that_comes_back_shares_the_work_again():
    found = constraints()
    assert found.update(state(lost=np.array([True, False])), None)
    assert found.planned.lost == (0,)
    assert not np.isfinite(found.planned.radius[0]).any()
    assert not found.update(state(lost=np.array([True, False])), None), "nothing has changed since"
    assert found.update(state(), None)
    assert found.planned.lost == ()
    assert np.isfinite(found.planned.radius).all()
