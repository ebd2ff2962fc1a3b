"""The lower rungs of the ladder: shifted plans and brakes are themselves plans that verify."""

from __future__ import annotations

import numpy as np
import pytest
from flights import fleet_of
from hypothesis import given
from hypothesis import strategies as st
from motions import PERIOD

from mpc_cover.model.braking import braking_trajectory, braking_velocities
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.verification.motion import verify_motion


def verified(plan, fleet, start):
    return verify_motion(fleet, plan.time, plan.position, plan.velocity, plan.input, at_rest=True, start=start)


@given(seed=st.integers(0, 10**6), dimension=st.sampled_from([2, 3]))
def test_braking_keeps_the_limits_and_ends_at_rest(seed, dimension):
    rng = np.random.default_rng(seed)
    position, velocity = rng.uniform(0, 9, (3, dimension)), rng.normal(size=(3, dimension))
    velocity *= rng.uniform(0, 1.5, (3, 1)) / np.linalg.norm(velocity, axis=1, keepdims=True)
    fleet = fleet_of(position, input_max=rng.uniform(0.3, 2.0, 3))
    plan = braking_trajectory(position, velocity, fleet, 7.0, PERIOD, 4)
    report = verified(plan, fleet, (position, velocity))
    assert report.holds, report.first_failure
    assert plan.steps >= 4
    assert braking_velocities(velocity, fleet, PERIOD)[-1].tolist() == np.zeros((3, dimension)).tolist()


def test_braking_goes_straight_on():
    fleet = fleet_of(np.zeros((1, 2)))
    plan = braking_trajectory(np.zeros((1, 2)), np.array([[1.5, 0.0]]), fleet, 0.0, PERIOD, 2)
    assert plan.position[-1, 0] == pytest.approx([0.75, 0.0])


@given(seed=st.integers(0, 10**6), done=st.integers(0, 6))
def test_a_shifted_plan_is_the_rest_of_the_old_one_and_then_rest(seed, done):
    rng = np.random.default_rng(seed)
    fleet = fleet_of(rng.uniform(0, 9, (2, 2)))
    plan = braking_trajectory(fleet.start, rng.uniform(-1, 1, (2, 2)), fleet, 3.0, PERIOD, 4)
    time = 3.0 + done * PERIOD
    position, velocity = plan.at(time)
    shifted = plan.remainder(time, position, velocity)
    assert verified(shifted, fleet, (position, velocity)).holds
    assert shifted.steps == plan.steps
    for later in (0.0, 0.3, 0.9, 5.0):
        assert shifted.at(time + later)[0] == pytest.approx(plan.at(time + later)[0], abs=1e-9)


def test_a_plan_knows_its_state_between_samples_and_after_its_end():
    fleet = fleet_of(np.zeros((1, 2)))
    plan = braking_trajectory(np.zeros((1, 2)), np.array([[1.0, 0.0]]), fleet, 0.0, 1.0, 2)
    position, velocity = plan.at(0.5)
    assert position[0, 0] == pytest.approx(0.5 + 0.5 * plan.input[0, 0, 0] * 0.25)
    assert velocity[0, 0] == pytest.approx(1.0 + 0.5 * plan.input[0, 0, 0])
    assert plan.at(99.0)[1].tolist() == [[0.0, 0.0]]
    assert Trajectory.at_rest(np.ones((1, 2)), 2.0, 0.5, 3).end_time == pytest.approx(3.5)
