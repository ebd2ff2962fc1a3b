"""Mission plans are asked for a part of the looks owed, and held to it."""

from __future__ import annotations

import numpy as np
import pytest
from mission_kinds import KINDS, mission_with

from mpc_cover.control.demand_allocation import DemandAllocation
from mpc_cover.control.receding_horizon import RecedingHorizon
from mpc_cover.information.build import make_map
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.model.sensing import look_counts
from mpc_cover.planning.budget import Budget
from mpc_cover.service.run.simulate import simulate
from mpc_cover.verification.check import check_trajectory


def start_of(mission, time=0.0):
    return FleetState.nominal(mission.fleet.start, np.zeros_like(mission.fleet.start), time, settled=time == 0.0)


@pytest.mark.parametrize(("owed", "asked"), [(2, 2), (3, 3), (4, 2), (15, 2)])
def test_many_looks_are_asked_for_lap_by_lap(owed, asked):
    mission = mission_with({"kind": "looks", "looks": owed})
    coverage, orders = make_map(mission), DemandAllocation(mission.field)
    weight, looks = orders.next(coverage, start_of(mission))
    np.testing.assert_array_equal(looks, asked)
    np.testing.assert_array_equal(weight, 1.0)
    assert orders.more == (owed > asked)


def test_what_is_left_is_what_was_asked_for_less_what_was_seen_and_what_the_rest_brings():
    mission = mission_with({"kind": "looks", "looks": 9}, radius=1.2)
    coverage = make_map(mission)
    orders, radius = DemandAllocation(mission.field), mission.fleet.radius
    orders.next(coverage, start_of(mission))
    coverage.observe(0.0, mission.fleet.start)
    later = mission.fleet.start + np.array([[[0.0, 1.0]], [[0.3, 1.5]]])
    weight, looks = orders.left(coverage, start_of(mission, 0.5), later, radius)
    seen = look_counts(mission.fleet.start[None], mission.field.cell, radius)
    brought = look_counts(later, mission.field.cell, radius)
    assert seen.any()
    assert brought.max() >= 2
    np.testing.assert_array_equal(looks, np.maximum(2 - seen - brought, 0))
    np.testing.assert_array_equal(weight > 0.0, looks > 0)


def test_plain_coverage_has_no_looks():
    mission = mission_with(None, radius=1.2)
    coverage, orders = make_map(mission), DemandAllocation(mission.field)
    weight, looks = orders.next(coverage, start_of(mission))
    assert looks is None
    assert weight.all()
    assert not orders.more
    here, radius = mission.fleet.start[None], mission.fleet.radius
    left, none = orders.left(coverage, start_of(mission), here, radius)
    assert none is None
    np.testing.assert_array_equal(left > 0.0, look_counts(here, mission.field.cell, radius) == 0)


def test_all_looks_are_asked_for_in_one_go():
    mission = mission_with({"kind": "looks", "looks": 15})
    coverage, orders = make_map(mission), DemandAllocation(mission.field)
    _, looks = orders.next(coverage, start_of(mission), single_pass=True)
    np.testing.assert_array_equal(looks, 15)
    assert not orders.more


@pytest.mark.parametrize("kind", [{"kind": "looks", "looks": 8}, {**KINDS["kalman"], "target_variance": 0.15}])
def test_a_fleet_brings_many_looks_in_one_slow_sweep(kind):
    mission = mission_with(kind, time_limit_s=120.0, planning_time_s=2.0)
    law = RecedingHorizon(mission)
    result = law.step(start_of(mission), make_map(mission), Budget.counted(mission.spec.control.planning_time_s))
    assert result.reason.startswith("slow ")
    flight = simulate(mission)
    assert flight.complete
    assert check_trajectory(flight.trajectory).holds
    # two looks a lap, as planned before, take four laps with a rest after each
    assert [step.kind for step in flight.steps].count("prepare") == 1


def test_a_question_about_one_go_begins_no_lap_of_a_patrol():
    mission = mission_with(KINDS["ageing"])
    coverage = make_map(mission)
    before = {name: array.copy() for name, array in coverage.state().items()}
    DemandAllocation(mission.field).next(coverage, start_of(mission, 30.0), single_pass=True)
    for name, array in coverage.state().items():
        np.testing.assert_array_equal(array, before[name])
