"""Offline plans: complete, verified, and honest when they cannot be."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from mpc_cover.errors import InvalidInputError, UserError
from mpc_cover.mission.load import build_mission, load_mission
from mpc_cover.planning.offline import PlanOptions, offline_task, plan_mission
from mpc_cover.verification.check import check_trajectory
from solvers.backends.registry import BACKENDS, backends_with_cones


def test_an_offline_plan_of_the_demo_mission_is_complete_and_passes_the_check():
    trajectory = plan_mission(load_mission("box-3"))
    assert np.isfinite(trajectory.covered_at).all()
    assert trajectory.time[-1] == pytest.approx(15.0)
    assert check_trajectory(trajectory).holds


@pytest.mark.parametrize("limit", [0.05, 1.0])
def test_whatever_the_time_limit_the_plan_is_feasible(limit):
    trajectory = plan_mission(load_mission("box-3"), PlanOptions(time_limit_s=limit))
    assert check_trajectory(trajectory).holds


@pytest.mark.parametrize("name", ["fig-3-1", "fig-3-4", "fixed-topology", "unequal-fleet"])
def test_the_cases_of_the_thesis_pass_the_check(name):
    trajectory = plan_mission(load_mission(name), PlanOptions(starts=4))
    report = check_trajectory(trajectory)
    assert report.holds, report.first_failure
    assert np.isfinite(trajectory.covered_at).mean() > 0.98


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fig-3-2", "fig-3-3", "fig-4-2", "fig-4-3", "fig-4-4", "fig-4-5", "volume-3"])
def test_the_larger_cases_pass_the_check_too(name):
    trajectory = plan_mission(load_mission(name))
    report = check_trajectory(trajectory)
    assert report.holds, report.first_failure
    assert np.isfinite(trajectory.covered_at).mean() > 0.9


def changed_box(**changes):
    """Return box-3 on a 5 m square with changes of its area."""
    spec = load_mission("box-3").spec.model_dump(by_alias=True, exclude_none=True)
    spec["area"] |= {"shape": {"kind": "box", "min_m": [0, 0], "max_m": [5, 5]}, **changes}
    spec["planning"]["duration_s"] = 12.0
    return build_mission(spec, "mission")


def test_several_looks_are_planned_and_counted():
    trajectory = plan_mission(changed_box(looks=3), PlanOptions(starts=3))
    assert trajectory.meta["cost_m"] == 0.0
    assert np.isfinite(trajectory.covered_at).all()
    assert check_trajectory(trajectory).holds


def test_cells_of_weight_zero_are_no_cells_and_others_weigh_what_the_map_says():
    mission = changed_box(weights={"values": [[1.0, 0.0], [2.0, 1.0]]})
    task = offline_task(mission)
    assert mission.field.size == 75
    assert set(task.weight[0]) == {1.0, 2.0}
    assert (mission.field.cell[task.weight[0] == 2.0] > [2.5, 0.0]).all()
    assert plan_mission(mission, PlanOptions(starts=2)).meta["cost_m"] == 0.0


def test_the_fault_of_any_sensor_leaves_everything_covered():
    """Section 4.1: fly the robust plan with each of the three sensors struck out."""
    spec = changed_box().spec.model_dump(by_alias=True, exclude_none=True)
    spec["fleet"]["faults_tolerated"] = 1
    spec["planning"]["duration_s"] = 16.0
    mission = build_mission(spec, "robust")
    trajectory = plan_mission(mission)
    assert trajectory.meta["cost_m"] == 0.0
    assert mission.fleet.magnitudes[0] == "coverage without a1"
    for lost in range(3):
        left = np.delete(trajectory.position, lost, axis=1).reshape(-1, 2)
        nearest = np.linalg.norm(mission.field.cell[:, None] - left, axis=2).min(axis=1)
        assert nearest.max() <= 1.0 + 1e-9


def test_offline_planning_says_what_is_wrong():
    spec = load_mission("box-3").spec.model_dump(by_alias=True)
    spec["planning"]["duration_s"] = 0.6
    with pytest.raises(InvalidInputError, match=r"planning\.duration_s"):
        build_mission(spec, "mission")


@pytest.mark.parametrize("name", BACKENDS)
def test_exact_cones_are_for_back_ends_that_have_them_and_the_message_lists_those(name):
    if name in backends_with_cones():
        assert PlanOptions(name, exact_cones=True).exact_cones
        return
    with pytest.raises(UserError, match=f"{name} has no second-order cones.*{' or '.join(backends_with_cones())}"):
        PlanOptions(name, exact_cones=True)


def test_without_a_duration_a_plan_takes_as_long_as_it_takes():
    spec = json.loads(load_mission("box-3").to_json())
    spec["area"]["shape"]["max_m"] = [14.0, 6.0]
    del spec["planning"]["duration_s"]
    plan = plan_mission(build_mission(spec, "box"), PlanOptions(starts=2))
    assert np.isfinite(plan.covered_at).all()
    assert check_trajectory(plan).holds


def limited(monkeypatch, **most):
    """Give back-ends other limits on the number of variables."""
    for name, variables in most.items():
        able = replace(BACKENDS[name].capabilities, variables_max=variables)
        monkeypatch.setattr(BACKENDS[name], "capabilities", able)


def test_qps_too_large_for_the_back_end_are_solved_by_the_next_and_the_plan_says_so(monkeypatch):
    mission, options = changed_box(), PlanOptions(starts=2, backend="piqp")
    assert set(plan_mission(mission, options).meta["qps"]) == {"piqp"}
    limited(monkeypatch, piqp=1)
    plans = [plan_mission(mission, options) for _ in range(2)]
    assert set(plans[0].meta["qps"]) == {"clarabel"}
    assert np.isfinite(plans[0].covered_at).all()
    assert plans[0].position.tobytes() == plans[1].position.tobytes()


def test_where_no_back_end_bears_the_qps_the_plan_says_so(monkeypatch):
    limited(monkeypatch, piqp=1, clarabel=1, osqp=1)
    spec = json.loads(changed_box().to_json())
    spec["planning"]["duration_s"] = 4.0
    mission = build_mission(spec, "too short for everything")
    plan = plan_mission(mission, PlanOptions(starts=2, backend="piqp"))
    assert plan.meta["qps"] == {}
    assert check_trajectory(plan).holds
    assert "more than any back-end" in plan.meta["stopped"]
