"""What continuous sensors measured between reports: nothing that the path did not pass."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpc_cover.information.build import make_map
from mpc_cover.information.replay import measured_at
from mpc_cover.mission.load import build_mission, load_mission
from mpc_cover.model.trajectory import Trajectory


def mission_of(sensing, speed=6.0, **control):
    raw = json.loads(load_mission("box-3").to_json())
    raw["sensing"] = sensing
    raw["fleet"]["defaults"] |= {"speed_max_m_per_s": speed, "input_max_m_per_s2": 6.0}
    raw["control"] |= control
    return build_mission(raw, "test")


def across(mission, seconds):
    """Return the map after the first agent crossed the field at 6 m/s, between two reports; the others are silent."""
    coverage = make_map(mission)
    silent = np.full((2, 2), np.nan)
    for time_s, x in ((0.0, 1.0), (seconds, 7.0)):
        coverage.observe(np.array([time_s, -np.inf, -np.inf]), np.concatenate([[[x, 5.0]], silent]))
    return coverage


def test_the_map_marks_what_the_chord_passes_only_where_sensing_is_continuous():
    between = (mission_of("sampled").field.cell == [4.25, 5.25]).all(axis=1)
    assert not across(mission_of("sampled"), 1.0).settled[between].any()
    assert across(mission_of("continuous"), 1.0).settled[between].all()


def test_after_a_jump_or_a_long_silence_nothing_between_counts():
    between = (mission_of("continuous").field.cell == [4.25, 5.25]).all(axis=1)
    assert not across(mission_of("continuous"), 0.5).settled[between].any(), "faster than it can fly"
    assert not across(mission_of("continuous"), 9.0).settled[between].any(), "anywhere meanwhile"


@given(seed=st.integers(0, 10**6), every=st.sampled_from([0.05, 0.1, 0.2]))
def test_what_the_map_marks_was_passed_and_next_to_all_that_was_passed_is_marked(seed, every):
    mission = mission_of("continuous", speed=20.0)
    rng = np.random.default_rng(seed)
    velocity = rng.uniform(-2.0, 2.0, (1, 3, 2)) + np.cumsum(rng.uniform(-1.0, 1.0, (8, 3, 2)), axis=0)
    flown = Trajectory.from_velocities(rng.uniform(2.0, 8.0, (3, 2)), velocity[0], velocity[1:], 0.0, 0.4)
    coverage = make_map(mission)
    for time_s in np.arange(0.0, flown.end_time + 1e-9, every):
        coverage.observe(float(time_s), flown.at(float(time_s))[0])
    passed = np.isfinite(measured_at(mission, flown.time, flown.position, flown.velocity))
    assert not (coverage.settled & ~passed).any()
    assert coverage.settled.sum() >= 0.9 * passed.sum()


def test_a_recording_knows_the_pass_and_sampled_sensing_does_not():
    position = np.repeat(np.array([[[1.0, 5.0]], [[9.0, 5.0]]]), 3, axis=1)
    velocity, time = np.full((2, 3, 2), [4.0, 0.0]), np.array([0.0, 2.0])
    continuous, sampled = (
        np.isfinite(measured_at(mission_of(kind), time, position, velocity)).sum() for kind in ("continuous", "sampled")
    )
    assert continuous == pytest.approx((16.0 + np.pi) / 0.25, rel=0.05), "a strip 2 m wide and two half discs"
    assert sampled < 0.4 * continuous
