"""One class of sampled motion: exact between samples, the same however it is cut, moved in time or looked at."""

from __future__ import annotations

import numpy as np
import pytest
from flights import fleet_of
from hypothesis import given, settings
from hypothesis import strategies as st
from motions import PERIOD

from mpc_cover.model.braking import braking_trajectory
from mpc_cover.model.motion import roll_out
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.verification.motion import verify_motion

seeds = st.integers(0, 2**32 - 1)


def random_trajectory(seed, steps=6, agents=3, period=0.5):
    rng = np.random.default_rng(seed)
    force = rng.normal(size=(steps, agents, 2))
    position, velocity = roll_out(*rng.normal(size=(2, agents, 2)), force, period)
    return Trajectory.even(float(rng.uniform(0, 1e5)), period, position, velocity, force)


@settings(max_examples=50, deadline=None)
@given(seeds, st.floats(-1.0, 5.0))
def test_between_samples_it_is_the_double_integrator_and_outside_it_stands_still(seed, after_s):
    motion = random_trajectory(seed)
    position, velocity = motion.at(motion.start_time + after_s)
    step = min(max(int(np.floor(after_s / 0.5 + 2e-8)), 0), motion.steps)
    elapsed = np.clip(after_s, 0.0, 3.0) - 0.5 * step
    force = motion.input[step] if step < motion.steps else 0.0
    np.testing.assert_allclose(velocity, motion.velocity[step] + elapsed * force, atol=1e-7)
    expected = motion.position[step] + elapsed * motion.velocity[step] + 0.5 * elapsed**2 * force
    np.testing.assert_allclose(position, expected, atol=1e-7)
    assert bool(motion.input_at(motion.start_time + after_s).any()) == (0.0 <= after_s + 1e-8 < 3.0 - 1e-8)


@settings(max_examples=50, deadline=None)
@given(seeds, st.lists(st.floats(-1.0, 4.0), min_size=1, max_size=8))
def test_many_times_are_looked_at_as_one_is(seed, after_s):
    motion = random_trajectory(seed)
    times = motion.start_time + np.array(after_s)
    for many, *each in zip(motion.at(times), *(motion.at(float(t)) for t in times), strict=True):
        assert np.array_equal(many, np.array(each))


@settings(max_examples=50, deadline=None)
@given(seeds, st.integers(0, 3), st.integers(3, 6), st.floats(-10.0, 10.0))
def test_an_agent_a_slice_and_another_clock_show_the_same_motion(seed, first, last, seconds):
    motion = random_trajectory(seed)
    part = motion.slice(first, last)
    assert (part.steps, part.start_time, part.end_time) == (last - first, motion.time[first], motion.time[last])
    for time in np.linspace(part.start_time, part.end_time, 7).tolist():
        whole = motion.at(time)
        later = part.shift(seconds).at(time + seconds)
        alone = motion.agent(1).at(time)
        for a, b, c, d in zip(whole, part.at(time), later, alone, strict=True):
            np.testing.assert_allclose(b, a, atol=1e-7)
            np.testing.assert_allclose(c, a, atol=1e-6)
            np.testing.assert_allclose(d, a[1], atol=1e-12)


@settings(max_examples=50, deadline=None)
@given(seeds, st.integers(0, 8))
def test_the_shifted_plan_is_the_rest_of_the_old_one_and_ends_at_rest(seed, done):
    motion = random_trajectory(seed)
    time = motion.start_time + 0.5 * done
    left = motion.remainder(time, *motion.at(time))
    assert left.steps == motion.steps
    assert not left.velocity[-1].any()
    shared = max(0, motion.steps - done - 1)
    np.testing.assert_allclose(left.velocity[1 : shared + 1], motion.velocity[done + 1 : done + shared + 1], atol=1e-9)


def test_at_rest_and_of_no_duration():
    still = Trajectory.at_rest(np.ones((1, 2)), 2.0, 0.5, 3)
    assert still.end_time == pytest.approx(3.5)
    instant = still.slice(1, 1)
    assert instant.steps == 0
    assert instant.at(99.0)[0].tolist() == [[1.0, 1.0]]
    assert not instant.input_at(2.5).any()


def verified(plan, fleet, start):
    return verify_motion(fleet, plan.time, plan.position, plan.velocity, plan.input, at_rest=True, start=start)


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
