"""Bounds by area: analytical cases, and that a bound from rest is one."""

from __future__ import annotations

import json

import numpy as np
import pytest
from flights import mission_of
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st

from mpc_cover.mission.load import load_mission
from mpc_cover.verification.area_bound import bound_from_rest, swath_bound


def test_swath_bound_of_box3_is_that_of_the_design():
    assert swath_bound(load_mission("box-3")) == pytest.approx(10.1, abs=0.05)


def test_swath_bound_does_not_apply_to_several_magnitudes_or_space():
    raw = json.loads(load_mission("box-3").to_json())
    several = mission_of(raw | {"magnitudes": ["a", "b"]})
    assert swath_bound(several) is None
    space = mission_of(
        raw
        | {
            "area": {"shape": {"kind": "box", "min_m": [0, 0, 0], "max_m": [4, 4, 4]}, "cell_size_m": 1.0},
            "fleet": raw["fleet"] | {"agents": [{"id": "a1", "start_m": [1, 1, 1]}]},
        }
    )
    assert swath_bound(space) is None


def test_swath_bound_of_an_area_covered_from_the_start_is_none():
    raw = json.loads(load_mission("box-3").to_json())
    raw["fleet"]["defaults"]["sensing_radius_m"] = 20.0
    assert swath_bound(mission_of(raw)) is None


def one_agent(size, speed, force, radius=1.0):
    raw = json.loads(load_mission("box-3").to_json())
    raw["area"]["shape"] = {"kind": "box", "min_m": [0.0, 0.0], "max_m": [size, 4.0]}
    raw["fleet"]["defaults"] = {
        "sensing_radius_m": radius,
        "speed_max_m_per_s": speed,
        "input_max_m_per_s2": force,
    }
    raw["fleet"]["agents"] = [{"id": "a1", "start_m": [1.0, 1.0]}]
    return mission_of(raw)


def test_a_continuous_sensor_from_rest_takes_the_time_to_get_up_to_speed_longer():
    mission = one_agent(10.0, speed=2.0, force=1.0)
    # a ramp of v / u = 2 s brings half the way of full speed
    assert bound_from_rest(mission) == pytest.approx(swath_bound(mission) + 0.5 * 2.0)


def test_looks_that_are_two_radii_apart_add_whole_discs():
    mission = one_agent(10.0, speed=100.0, force=1e4)
    left = 40.0 - np.pi
    assert bound_from_rest(mission, 1.0) == pytest.approx(np.ceil(left / np.pi))


@examples(deadline=None, max_examples=40)
@given(
    speed=st.floats(0.3, 2.0),
    force=st.floats(0.5, 5.0),
    look_s=st.sampled_from([0.0, 0.1, 0.5, 2.0]),
    seed=st.integers(0, 99),
)
def test_no_motion_from_rest_sees_more_than_the_bound_lets_expect(speed, force, look_s, seed):
    mission = one_agent(10.0, speed, force)
    bound = bound_from_rest(mission, look_s)
    assert bound >= swath_bound(mission, look_s) - 1e-9
    rng, step, limit = np.random.default_rng(seed), 0.05, 40.0 - np.pi
    heading, way, velocity = np.cumsum(rng.normal(size=4000) * 0.02), [np.zeros(2)], 0.0
    for turn in heading:  # the best there is: at full input, then at full speed, on a nearly straight line
        before, velocity = velocity, min(speed, velocity + force * step)
        way.append(way[-1] + 0.5 * (before + velocity) * step * np.array([np.cos(turn), np.sin(turn)]))
    place = np.array(way)[:: max(1, round(look_s / step))]
    apart = np.clip(0.5 * np.linalg.norm(np.diff(place, axis=0), axis=1), 0.0, 1.0)
    new = np.cumsum(np.pi - 2.0 * (np.arccos(apart) - apart * np.sqrt(1.0 - apart**2)))  # at most, overlaps ignored
    if (new >= limit).any():
        assert (np.argmax(new >= limit) + 1) * max(look_s, step) >= bound - (step if look_s == 0.0 else 1e-9)
