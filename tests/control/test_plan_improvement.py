"""One receding-horizon step: cells that would be left behind are taken in passing."""

from __future__ import annotations

import numpy as np
from closed_loop import at_start, step_budget

from mpc_cover.control.demand_allocation import DemandAllocation
from mpc_cover.control.plan_improvement import PlanImprovement
from mpc_cover.control.planning_constraints import PlanningConstraints
from mpc_cover.information.build import make_map
from mpc_cover.mission.load import build_mission
from mpc_cover.model.sensing import covered_at
from mpc_cover.planning.initial_guess.waypoint_tracking import track_waypoints
from mpc_cover.planning.planner import Planner


def corridor():
    """Return a mission with one agent in a corridor 30 m x 1 m whose motion box leaves room beside it."""
    return build_mission(
        {
            "schema": 1,
            "name": "corridor",
            "area": {
                "shape": {"kind": "box", "min_m": [0.0, 0.0], "max_m": [30.0, 1.0]},
                "cell_size_m": 0.5,
                "motion_min_m": [-1.0, -2.0],
                "motion_max_m": [31.0, 3.0],
            },
            "fleet": {
                "defaults": {"sensing_radius_m": 1.0, "input_max_m_per_s2": 1.5, "speed_max_m_per_s": 1.5},
                "agents": [{"id": "a1", "start_m": [0.5, 1.1]}],
            },
            "control": {"period_s": 0.5, "horizon_steps": 20},
        },
        "corridor",
    )


def test_a_plan_that_would_come_back_for_a_cell_takes_it_in_passing():
    """The way there is too high for the lowest cells about x = 4 m, and the plan comes back for them over 27 m."""
    mission = corridor()
    fleet, cell = mission.fleet, mission.field.cell
    way = np.array([[2.0, 0.5], [4.0, 1.7], [6.0, 0.5], [30.0, 0.5], [4.0, 0.4]])
    plan = track_waypoints([way], fleet.start, np.zeros_like(fleet.start), fleet, 0.5)
    state, coverage = at_start(mission), make_map(mission)
    constraints, allocation = PlanningConstraints(mission), DemandAllocation(mission.field)
    constraints.update(state, None)
    allocation.next(coverage, state)
    before = covered_at(plan.time, plan.position, cell, fleet.radius)
    assert np.isfinite(before).all()
    assert before.max() > 0.9 * plan.end_time
    assert np.sort(before)[-4] < 0.6 * plan.end_time  # all but a few cells are covered on the way there
    improvement = PlanImprovement(mission, constraints, allocation, Planner("piqp"))
    improved, reason = improvement.improved(plan, state, coverage, None, step_budget())
    assert reason == "cells taken in passing"
    after = covered_at(improved.time, improved.position, cell, fleet.radius)
    assert after.max() < 0.6 * plan.end_time
