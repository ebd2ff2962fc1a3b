"""Fast agents with long periods: what passes count as is what is planned, marked, verified and bounded."""

from __future__ import annotations

import json

import numpy as np
import pytest

from mpc_cover.mission.load import build_mission, load_mission
from mpc_cover.planning.offline import PlanOptions, plan_mission
from mpc_cover.service.run.simulate import simulate
from mpc_cover.verification.check import check_trajectory
from mpc_cover.verification.summary import summarise


def mission_of(sensing="sampled", period=1.0, speed=4.0, force=4.0, side=8.0, **changes):
    """Return two agents on a square, apart by 0.5 m and connected."""
    raw = json.loads(load_mission("box-3").to_json())
    raw["area"]["shape"] |= {"max_m": [side, side]}
    raw["fleet"]["defaults"] |= {"input_max_m_per_s2": force, "speed_max_m_per_s": speed}
    raw["fleet"]["agents"] = [{"id": "a1", "start_m": [2.0, 2.0]}, {"id": "a2", "start_m": [4.0, 2.0]}]
    control = {"period_s": period, "horizon_steps": 20, "planning_time_s": 0.5}
    return build_mission(raw | {"sensing": sensing, "control": control} | changes, "test")


def flown(mission):
    """Return the summary of a simulated flight, complete and verified."""
    flight = simulate(mission)
    report = check_trajectory(flight.trajectory)
    assert report.holds, report.failures
    assert flight.complete
    summary = summarise(flight.trajectory, report)
    assert summary.covered_cells == summary.cells
    return summary


@pytest.mark.parametrize("sensing", ["sampled", "continuous"])
def test_agents_that_fly_four_radii_a_period_measure_on_the_way(sensing):
    summary = flown(mission_of(sensing))
    assert summary.ratio_to_bound is not None
    assert summary.ratio_to_bound < 2.6, "flown by samples alone it was above 3.5"


def test_eight_radii_a_step_are_flown_by_control_points_not_by_margins():
    summary = flown(mission_of("continuous", period=2.0))
    assert summary.time_to_99_s is not None
    assert summary.time_to_99_s < 20.0, "with margins u T^2 / 8 from walls and each other it was above 40 s"


def test_a_sampled_plan_is_flown_as_slowly_as_its_looks_need():
    mission = mission_of(side=6.0, planning={"duration_s": 30.0})
    plan = plan_mission(mission, PlanOptions(starts=4, min_time=True, time_limit_s=2.0))
    report = check_trajectory(plan)
    assert report.holds, report.failures
    assert np.isfinite(plan.covered_at).all()
    summary = summarise(plan, report)
    assert summary.ratio_to_bound is not None
    assert 1.0 < summary.ratio_to_bound < 3.0, "a look adds a disc at most"


def test_a_weak_input_flies_slower_sweeps_and_keeps_to_a_plan_that_straight_braking_would_take_into_a_wall():
    summary = flown(mission_of(period=0.5, speed=1.5, force=0.21, side=6.0))
    assert summary.time_to_99_s is not None
    assert summary.time_to_99_s < 26.0, "broken off half-way it took 32 s"
