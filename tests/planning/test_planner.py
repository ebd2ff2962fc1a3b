"""Plans from scratch: complete, short, verified; honest when they cannot be."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from flights import fleet_of
from motions import PERIOD, grid

from mpc_cover.errors import InvalidInputError, UserError
from mpc_cover.mission.load import build_mission, load_mission
from mpc_cover.planning.min_time import plan_free_horizon, plan_min_time
from mpc_cover.planning.multistart import Search, initial_guesses, multistart
from mpc_cover.planning.offline import PlanOptions, offline_task, plan_mission
from mpc_cover.planning.planner import Planner
from mpc_cover.planning.task import Task
from mpc_cover.verification.check import check_trajectory
from mpc_cover.verification.motion import verify_motion
from solvers.backends.registry import BACKENDS, backends_with_cones, make_backend


def small_task(agents=2, size=8, spacing=0.5):
    """Return a 4 m x 4 m square and a fleet near its corner."""
    start = np.array([[0.6, 0.6], [1.6, 0.6]])[:agents]
    fleet = fleet_of(
        start, separation_min=0.5, communication_range=3.0, motion_min=np.zeros(2), motion_max=np.full(2, 4.0)
    )
    cell = grid(size, spacing)
    return Task(fleet, cell, np.ones((1, cell.shape[0])), start, np.zeros_like(start), 0.0, PERIOD)


def holds(task, plan):
    report = verify_motion(
        task.fleet,
        plan.time,
        plan.position,
        plan.velocity,
        plan.input,
        at_rest=True,
        start=(task.position, task.velocity),
    )
    return report.holds


@pytest.mark.parametrize("backend", ["piqp", "osqp", "clarabel"])
def test_a_whole_plan_covers_everything_and_verifies(backend):
    task = small_task()
    found = plan_free_horizon(task, make_backend(backend), attempts=3)
    assert found.complete
    assert holds(task, found.plan)
    assert found.plan.steps * PERIOD < 8.0


def test_a_single_agent_plans_too():
    task = small_task(agents=1)
    found = plan_free_horizon(task, make_backend("piqp"), attempts=4)
    assert found.complete
    assert holds(task, found.plan)


def test_a_fleet_that_moves_is_planned_from_its_velocity():
    task = replace(small_task(), velocity=np.array([[0.0, 1.2], [0.0, 1.2]]))
    found = plan_free_horizon(task, make_backend("piqp"), attempts=2)
    assert found.feasible
    assert holds(task, found.plan)


def test_with_nothing_owed_it_stays_and_with_no_time_it_still_answers():
    task = small_task()
    nothing = replace(task, weight=np.zeros_like(task.weight))
    assert plan_free_horizon(nothing, make_backend("piqp")).plan.position[-1] == pytest.approx(task.position)
    late = plan_free_horizon(task, make_backend("piqp"), deadline=time.perf_counter() - 1.0)
    assert late.feasible
    assert holds(task, late.plan)


def test_what_is_too_short_for_everything_is_still_feasible_and_best_effort():
    task = small_task()
    found = multistart(task, make_backend("piqp"), 4)[0]
    assert found.feasible
    assert not found.complete
    assert found.plan.steps == 4
    assert holds(task, found.plan)


def test_a_start_that_is_given_takes_the_way_of_a_guess():
    task, backend, alone = small_task(), make_backend("piqp"), Search(starts=1, finalists=1, rounds=2)
    guess = next(initial_guesses(task, alone))
    x = task.ocp(12).exact_ends(task.flown(guess, 12).decision)
    own, given = (multistart(task, backend, 12, alone, given=start) for start in (None, {"mine": x}))
    assert [one.plan.velocity.tobytes() for one in own] == [one.plan.velocity.tobytes() for one in given]
    assert {one.kind for one in given} == {"mine", "rest"}


def test_whoever_looks_on_sees_all_iterates_and_changes_nothing():
    seen = []
    task, search = small_task(), Search(starts=2, finalists=1, rounds=1)
    plain = multistart(task, make_backend("piqp"), 9, search)
    looked_at = multistart(replace(task, on_iterate=seen.append), make_backend("piqp"), 9, search)
    assert [one.plan.velocity.tobytes() for one in plain] == [one.plan.velocity.tobytes() for one in looked_at]
    taken = [step for one in plain if one.refined for stage in one.refined.stages for step in stage.history]
    assert len(seen) >= sum(step.accepted for step in taken) > 0
    best, ocp = looked_at[0], task.ocp(9)
    assert any(np.array_equal(ocp.motion(x)[1], best.plan.velocity) for x in seen)


def test_whoever_looks_on_may_end_the_search():
    with pytest.raises(ZeroDivisionError):
        multistart(replace(small_task(), on_iterate=lambda _: 1 / 0), make_backend("piqp"), 9)


def test_it_is_deterministic():
    one, two = (plan_free_horizon(small_task(), make_backend("piqp"), attempts=2) for _ in range(2))
    assert one.plan.velocity.tobytes() == two.plan.velocity.tobytes()


def test_an_offline_plan_of_the_demo_mission_is_complete_and_passes_the_check():
    trajectory = plan_mission(load_mission("box-3"))
    assert np.isfinite(trajectory.covered_at).all()
    assert trajectory.time[-1] == pytest.approx(15.0)
    assert check_trajectory(trajectory).holds


def test_more_starts_are_random_relatives_and_the_same_for_a_seed():
    task = small_task()
    names = [[g.kind for g, _ in zip(initial_guesses(task, Search(seed=4)), range(24), strict=False)] for _ in range(2)]
    assert names[0] == names[1]
    assert len(set(names[0])) == 24
    assert "random" in names[0][-1]
    only = list(initial_guesses(task, Search(kinds=("tour", names[0][1]))))
    assert [guess.kind for guess in only] == ["tour", names[0][1]]


def test_the_shortest_plan_is_complete_and_one_sample_less_was_tried():
    task, told = small_task(), []
    found = plan_min_time(
        task,
        make_backend("piqp"),
        search=Search(starts=4, finalists=1),
        on_progress=lambda n, c: told.append((n, c.complete)),
    )
    assert found.complete
    assert holds(task, found.plan)
    assert told[-1] == (found.plan.steps - 1, False)


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
    with pytest.raises(UserError, match="clarabel"):
        Planner("gurobi")


@pytest.mark.parametrize("name", BACKENDS)
def test_exact_cones_are_for_back_ends_that_have_them_and_the_message_lists_those(name):
    if name in backends_with_cones():
        assert PlanOptions(name, exact_cones=True).exact_cones
        return
    with pytest.raises(UserError, match=f"{name} has no second-order cones.*{' or '.join(backends_with_cones())}"):
        PlanOptions(name, exact_cones=True)


def test_a_large_task_that_nothing_keeps_gets_an_answer_that_says_so():
    slow = replace(small_task().fleet, speed_max=np.full(2, 0.02), separation_min=1.5)
    best = plan_free_horizon(
        replace(small_task(), fleet=slow), make_backend("piqp"), deadline=time.perf_counter() - 1.0
    )
    assert not best.feasible
