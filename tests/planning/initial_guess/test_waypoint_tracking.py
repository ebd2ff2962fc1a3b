"""Flying through waypoints, or where samples want one to be: within the limits, to rest."""

from __future__ import annotations

import numpy as np
import pytest
from flights import fleet_of
from hypothesis import given, settings
from hypothesis import strategies as st
from motions import PERIOD

from mpc_cover.planning.initial_guess.waypoint_tracking import track_samples, track_waypoints
from mpc_cover.verification.motion import verify_motion


def verified(flight, fleet):
    force = np.diff(flight.velocity, axis=0) / PERIOD
    time = PERIOD * np.arange(flight.steps + 1)
    return verify_motion(fleet, time, flight.position, flight.velocity, force, at_rest=True)


@settings(max_examples=40)
@given(seed=st.integers(0, 10**6), steps=st.one_of(st.none(), st.integers(4, 30)))
def test_following_random_waypoints_keeps_all_limits_and_ends_at_rest(seed, steps):
    rng = np.random.default_rng(seed)
    agents = int(rng.integers(1, 4))
    start = rng.uniform(0.5, 9.5, (agents, 2))
    fleet = fleet_of(
        start,
        input_max=rng.uniform(0.5, 2.0, agents),
        speed_max=rng.uniform(0.5, 2.0, agents),
        motion_min=np.zeros(2),
        motion_max=np.full(2, 10.0),
    )
    paths = [rng.uniform(0.5, 9.5, (int(rng.integers(1, 5)), 2)) for _ in range(agents)]
    flight = track_waypoints(paths, start, np.zeros_like(start), fleet, PERIOD, steps=steps)
    report = verified(flight, fleet)
    assert report.holds, report.first_failure
    if steps is not None:
        assert flight.steps == steps


def test_without_a_number_of_steps_it_arrives():
    start = np.array([[1.0, 1.0]])
    flight = track_waypoints([np.array([[8.0, 1.0], [8.0, 6.0]])], start, np.zeros((1, 2)), fleet_of(start), PERIOD)
    assert flight.position[-1, 0] == pytest.approx([8.0, 6.0], abs=0.6)


@settings(max_examples=60)
@given(seed=st.integers(0, 10**6), period=st.sampled_from([0.2, 0.5, 1.0, 2.0]))
def test_it_arrives_in_time_however_far_it_goes_in_a_sample(seed, period):
    rng = np.random.default_rng(seed)
    start, speed, force = rng.uniform(0.0, 6.0, (1, 2)), rng.uniform(0.2, 2.0), rng.uniform(0.3, 3.0)
    fleet = fleet_of(start, input_max=np.array([force]), speed_max=np.array([speed]))
    path = rng.uniform(0.0, 6.0, (int(rng.integers(1, 12)), 2))
    flight = track_waypoints([path], start, np.zeros_like(start), fleet, period)
    length = float(np.linalg.norm(np.diff(np.concatenate([start, path]), axis=0), axis=1).sum())
    turns = (len(path) + 1) * (2.0 * speed / force + 2.0 * period)
    assert flight.steps * period < 2.0 * (length / speed + turns)


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6), steps=st.integers(1, 30), wild=st.floats(0.0, 3.0))
def test_whatever_is_wanted_the_motion_keeps_the_limits_and_ends_at_rest(seed, steps, wild):
    rng = np.random.default_rng(seed)
    fleet = fleet_of(rng.uniform(-1.0, 1.0, (3, 2)))
    wanted = fleet.start + np.cumsum(rng.normal(scale=wild, size=(steps + 1, 3, 2)), axis=0)
    motion = track_samples(wanted, fleet.start, np.zeros((3, 2)), fleet, PERIOD)
    force = np.diff(motion.velocity, axis=0) / PERIOD
    assert np.linalg.norm(motion.velocity, axis=2).max() <= 1.5
    assert np.linalg.norm(force, axis=2).max() <= 1.5 + 1e-9
    assert not motion.velocity[-1].any()
    report = verified(motion, fleet)
    assert report.holds, report.first_failure


def test_what_is_wanted_slowly_is_flown_closely():
    fleet, turn = fleet_of(np.array([[2.0, 0.0]])), np.linspace(0.0, np.pi, 60)
    wanted = np.stack([2.0 * np.cos(turn), 2.0 * np.sin(turn)], axis=1)[:, None]
    motion = track_samples(wanted, fleet.start, np.zeros((1, 2)), fleet, PERIOD)
    assert np.abs(motion.position[: len(wanted)] - wanted).max() < 0.08
