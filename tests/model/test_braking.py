"""Braking: within the limits, straight on, to rest."""

from __future__ import annotations

import numpy as np
import pytest
from flights import fleet_of
from hypothesis import given, settings
from hypothesis import strategies as st
from motions import PERIOD

from mpc_cover.model.braking import braking_distance_gradient, braking_position, braking_trajectory, braking_velocities
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


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_way_that_braking_takes_has_this_slope(seed):
    rng = np.random.default_rng(seed)
    velocity, normal = rng.normal(size=(2, 5, 2))
    later, input_max = rng.uniform(0.1, 2.0, 5), rng.uniform(0.5, 2.0, 5)
    change = 1e-6 * rng.normal(size=(5, 2))

    def way(v):
        zero = np.zeros((1, 2))
        each = [braking_position(zero, v[i : i + 1], later[i : i + 1], input_max[i : i + 1])[0, 0] for i in range(5)]
        return np.einsum("cd,cd->c", normal, np.array(each))

    slope = braking_distance_gradient(normal, velocity, later, input_max)
    gained = np.einsum("cd,cd->c", slope, change)
    assert way(velocity + change) - way(velocity) == pytest.approx(gained, abs=1e-10)
