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
from mpc_cover.planning.engine import Engine
from mpc_cover.planning.offline import plan_mission
from mpc_cover.planning.planner import Task, plan_for, plan_whole
from mpc_cover.verification.check import check_trajectory
from mpc_cover.verification.motion import verify_motion
from solvers.backends.registry import make_backend


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
        plan.time(),
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
    found = plan_whole(task, make_backend(backend), attempts=3, starts=2)
    assert found.complete
    assert holds(task, found.plan)
    assert found.plan.steps * PERIOD < 8.0


def test_a_single_agent_plans_too():
    task = small_task(agents=1)
    found = plan_whole(task, make_backend("piqp"), attempts=4)
    assert found.complete
    assert holds(task, found.plan)


def test_a_fleet_that_moves_is_planned_from_its_velocity():
    task = replace(small_task(), velocity=np.array([[0.0, 1.2], [0.0, 1.2]]))
    found = plan_whole(task, make_backend("piqp"), attempts=2, starts=1)
    assert found.feasible
    assert holds(task, found.plan)


def test_with_nothing_owed_it_stays_and_with_no_time_it_still_answers():
    task = small_task()
    nothing = replace(task, weight=np.zeros_like(task.weight))
    assert plan_whole(nothing, make_backend("piqp")).plan.position[-1] == pytest.approx(task.position)
    late = plan_whole(task, make_backend("piqp"), deadline=time.perf_counter() - 1.0)
    assert late.feasible
    assert holds(task, late.plan)


def test_what_is_too_short_for_everything_is_still_feasible_and_best_effort():
    task = small_task()
    found = plan_for(task, make_backend("piqp"), 4)
    assert found.feasible
    assert not found.complete
    assert found.plan.steps == 4
    assert holds(task, found.plan)


def test_it_is_deterministic():
    one, two = (plan_whole(small_task(), make_backend("piqp"), attempts=2) for _ in range(2))
    assert one.plan.velocity.tobytes() == two.plan.velocity.tobytes()


def test_an_offline_plan_of_the_demo_mission_is_complete_and_passes_the_check():
    trajectory = plan_mission(load_mission("box-3"))
    assert np.isfinite(trajectory.covered_at).all()
    assert trajectory.time[-1] == pytest.approx(15.0)
    assert check_trajectory(trajectory).holds


def test_offline_planning_says_what_is_wrong():
    spec = load_mission("box-3").spec.model_dump(by_alias=True)
    spec["planning"]["duration_s"] = 0.6
    with pytest.raises(InvalidInputError, match=r"planning\.duration_s"):
        plan_mission(build_mission(spec, "mission"))
    with pytest.raises(UserError, match="clarabel"):
        Engine("gurobi")
