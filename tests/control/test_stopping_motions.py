"""The earliest verified motion to rest: at once where that is safe, else later along the plan in force."""

from dataclasses import replace

import numpy as np
import pytest
from closed_loop import PERIOD, small_mission

from mpc_cover.control.safety_filter import SafetyFilter
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.verification.motion import verify_motion

STEPS = 8


def one_behind_the_other(gap=0.8):
    """A strong agent ahead of one that brakes weakly, both at 1 m/s: the plan lets the weak one brake first."""
    agents = [
        {"id": "a1", "start_m": [1.0 + gap, 1.0], "input_max_m_per_s2": 2.0},
        {"id": "a2", "start_m": [1.0, 1.0], "input_max_m_per_s2": 0.5},
    ]
    mission = small_mission(horizon=STEPS, agents=agents)
    velocity = np.array([[1.0, 0.0], [1.0, 0.0]])
    state = FleetState.nominal(mission.fleet.start, velocity, 0.0)
    later = np.zeros((STEPS, 2, 2))
    later[:5, 0, 0] = 1.0
    later[:4, 1, 0] = [0.75, 0.5, 0.25, 0.0]
    return mission, state, Trajectory.from_velocities(mission.fleet.start, velocity, later, 0.0, PERIOD)


def rests_after(motion):
    return int(np.flatnonzero((np.abs(motion.velocity) > 1e-6).any(axis=(1, 2)))[-1]) + 1


def test_where_braking_at_once_is_not_safe_everyone_stops_at_the_first_sample_at_which_it_is():
    mission, state, plan = one_behind_the_other()
    gate = SafetyFilter(mission)
    stop = gate.earliest_stop(state, plan, on_sample=True)
    assert gate.admit(stop, state, plan).admitted
    report = verify_motion(mission.fleet, stop.time, stop.position, stop.velocity, stop.input, at_rest=True)
    assert report.holds
    assert rests_after(stop) < rests_after(plan)
    assert (stop.velocity[1, 0] == plan.velocity[1, 0]).all(), "the one ahead does not brake yet"
    assert gate.earliest_stop(state, plan, on_sample=False) is None


def test_where_braking_at_once_is_safe_everyone_does():
    mission, state, plan = one_behind_the_other(gap=1.9)
    for on_sample in (True, False):
        stop = SafetyFilter(mission).earliest_stop(state, plan, on_sample=on_sample)
        assert rests_after(stop) == 4, "that of the weaker one, 2 s"
        assert np.linalg.norm(stop.input[0], axis=1) == pytest.approx(mission.fleet.input_max, rel=1e-6)


def test_without_a_plan_in_force_everyone_brakes():
    mission, state, _ = one_behind_the_other(gap=1.9)
    assert rests_after(SafetyFilter(mission).earliest_stop(state, None, on_sample=True)) == 4


def test_where_the_bounds_are_violated_already_the_stop_attains_what_the_plan_does():
    mission, state, plan = one_behind_the_other()
    nearer = np.array([[0.4, 0.0], [0.0, 0.0]])
    state, plan = (replace(one, position=one.position - nearer) for one in (state, plan))
    stop = SafetyFilter(mission).earliest_stop(state, plan, on_sample=True)
    gap = [np.linalg.norm(motion.position[:, 0] - motion.position[:, 1], axis=1).min() for motion in (stop, plan)]
    assert gap[0] >= gap[1] - 1e-6
    assert not stop.velocity[-1].any()


def test_the_lost_are_obstacles():
    mission, state, plan = one_behind_the_other()
    lost = np.array([False, True])
    velocity = np.where(lost[:, None], 0.0, state.velocity)
    stop = SafetyFilter(mission).earliest_stop(replace(state, lost=lost, velocity=velocity), plan, on_sample=True)
    assert rests_after(stop) == 1
