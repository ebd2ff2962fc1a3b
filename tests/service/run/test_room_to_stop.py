"""Agents die in flight: nobody runs into them before it is known, and they die when they are told to."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_mission import TINY

from mpc_cover.control.planning_constraints import PlanningConstraints
from mpc_cover.control.receding_horizon import RecedingHorizon
from mpc_cover.information.build import make_map
from mpc_cover.mission.load import build_mission, load_mission
from mpc_cover.model.fleet_constraints import FleetConstraints
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.planning.budget import Budget
from mpc_cover.planning.planner import Planner
from mpc_cover.planning.scp import BRAKING_TOLERANCE
from mpc_cover.planning.task import Task
from mpc_cover.service.run.simulate import simulate
from mpc_cover.verification.check import check_trajectory

CROWD = {
    "schema": 1,
    "name": "crowd",
    "area": {
        "shape": {
            "kind": "polygon",
            "outline_m": [[0.0, 0.0], [5.6, 0.0], [5.6, 5.6], [0.0, 5.6]],
            "holes_m": [[[1.9, 1.9], [3.86, 1.9], [3.86, 3.58], [1.9, 3.58]]],
        },
        "cell_size_m": 0.75,
    },
    "fleet": {
        "defaults": {"sensing_radius_m": 0.74, "input_max_m_per_s2": 1.59, "speed_max_m_per_s": 1.54},
        "agents": [
            {"id": "a1", "start_m": [3.53, 0.15], "sensing_radius_m": 1.13},
            {"id": "a2", "start_m": [2.53, 0.21], "speed_max_m_per_s": 1.98},
            {"id": "a3", "start_m": [3.69, 0.7], "input_max_m_per_s2": 1.27},
            {"id": "a4", "start_m": [4.53, 1.23], "input_max_m_per_s2": 1.1, "sensing_radius_m": 1.02},
            {"id": "a5", "start_m": [4.22, 2.16], "speed_max_m_per_s": 1.97, "input_max_m_per_s2": 0.77},
            {"id": "a6", "start_m": [2.8, 1.49]},
        ],
        "separation_min_m": 0.5,
        "communication_range_m": 1.46,
    },
    "control": {"period_s": 1.0, "horizon_steps": 12, "planning_time_s": 2.0},
    "disturbance": {"input_noise_m_per_s2": 0.056, "wind_m_per_s2": [-0.001, -0.009]},
}


@pytest.mark.parametrize("death_s", [3.82, 5.3])
def test_a_crowd_runs_into_nobody_who_dies(death_s):
    """Six in a narrow ring, a second a period: plans without room for it came within 0.3 m of the dead."""
    flown = simulate(build_mission(CROWD, "crowd"), seed=3014, deaths={"a2": death_s})
    assert flown.complete
    assert not check_trajectory(flown.trajectory).failures


def test_plans_of_a_flight_leave_room_to_stop_and_those_without_do_not():
    mission = load_mission("heterogeneous")
    constraints, law, coverage = PlanningConstraints(mission), RecedingHorizon(mission), make_map(mission)
    control, still = mission.spec.control, np.zeros_like(mission.fleet.start)
    state = FleetState.nominal(mission.fleet.start, still, 0.0, settled=True)
    for _ in range(25):
        budget = control.planning_time_s if state.settled else control.deadline_fraction * control.period_s
        plan = law.step(state, coverage, Budget.counted(budget)).trajectory
        assert constraints.braking_violation(plan) <= BRAKING_TOLERANCE
        law.published(plan)
        time_s = state.time + control.period_s
        state = FleetState.nominal(*plan.at(time_s), time_s)
        coverage.observe(time_s, state.position)
    assert coverage.covered_count > 0.5 * mission.field.size
    cells = np.ones((mission.fleet.radius.shape[1], mission.field.size))
    fleet = FleetConstraints.of(mission.fleet)
    task = Task(fleet, mission.field.cell, cells, fleet.start, still, 0.0, control.period_s)
    assert constraints.braking_violation(Planner("piqp").thorough(task, Budget.counted(0.5)).plan) > BRAKING_TOLERANCE


@pytest.mark.parametrize("death_s", [1.5, 1.83])
def test_who_is_told_to_die_brakes_from_its_last_report_before_that(death_s):
    flown = simulate(build_mission(TINY, "tiny"), deaths={"a2": death_s}).trajectory
    braking = np.flatnonzero(np.linalg.norm(flown.input[:, 1], axis=1) > 0.0)[-1]
    begun = flown.time[braking]
    while braking and flown.input[braking - 1, 1] == pytest.approx(flown.input[braking, 1]):
        braking -= 1
        begun = flown.time[braking]
    period_s = flown.mission.spec.control.state_period_s
    assert death_s - period_s - 1e-6 <= begun < death_s
