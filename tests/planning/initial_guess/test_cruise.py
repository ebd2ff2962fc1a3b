"""Sweeps are flown as fast as turns and looks allow, and no slower."""

from __future__ import annotations

import json

import numpy as np
import pytest

from mpc_cover.mission.load import build_mission, load_mission
from mpc_cover.planning.initial_guess.cruise import cruise_speeds
from mpc_cover.planning.multistart import systematic_guesses
from mpc_cover.planning.offline import offline_task


def task_of(speed=1.5, force=1.5, period=0.5, sensing="sampled"):
    raw = json.loads(load_mission("box-3").to_json())
    raw["fleet"]["defaults"] |= {"speed_max_m_per_s": speed, "input_max_m_per_s2": force}
    raw["control"] |= {"period_s": period, "horizon_steps": 40}
    return offline_task(build_mission(raw | {"sensing": sensing}, "test"))


def uncovered(task, guess):
    return float((task.remaining_after(task.flown(guess, None)) > 0.0).mean())


def test_where_turns_are_narrow_and_looks_overlap_full_speed_is_the_only_one():
    assert [speed.tolist() for speed in cruise_speeds(task_of())] == [[1.5] * 3]
    assert all(guess.cruise is None for guess in systematic_guesses(task_of()))


@pytest.mark.parametrize("unit", [1e-3, 1e3])
def test_speeds_scale_with_lengths(unit):
    raw = json.loads(load_mission("box-3").to_json())
    raw["fleet"]["defaults"] |= {"input_max_m_per_s2": 0.2}
    one = offline_task(build_mission(raw, "one"))
    defaults = raw["fleet"]["defaults"]
    for name in ("sensing_radius_m", "input_max_m_per_s2", "speed_max_m_per_s"):
        defaults[name] *= unit
    raw["fleet"] |= {"separation_min_m": 0.5 * unit, "communication_range_m": 5.5 * unit}
    for agent in raw["fleet"]["agents"]:
        agent["start_m"] = [unit * x for x in agent["start_m"]]
    raw["area"] = {
        "shape": {"kind": "box", "min_m": [0, 0], "max_m": [10 * unit, 10 * unit]},
        "cell_size_m": 0.5 * unit,
    }
    other = offline_task(build_mission(raw, "other"))
    np.testing.assert_allclose(np.array(cruise_speeds(other)), unit * np.array(cruise_speeds(one)))


def test_a_weak_input_makes_sweeps_slower_so_that_they_cover_what_they_pass():
    task = task_of(force=0.21)
    guesses = [guess for guess in systematic_guesses(task) if guess.origin.name.startswith("comb")]
    slower = [guess for guess in guesses if guess.cruise is not None and (guess.cruise < 1.4).all()]
    assert len(slower) >= len(guesses) // 2
    at_full_speed = [type(guess)(guess.origin, guess.paths) for guess in slower]
    for careful, fast in zip(slower, at_full_speed, strict=True):
        assert uncovered(task, careful) < uncovered(task, fast)


def test_sampled_looks_limit_the_speed_and_continuous_ones_do_not():
    sampled = cruise_speeds(task_of(speed=4.0, force=4.0, period=1.0))
    assert sampled[0] == pytest.approx([1.4] * 3)
    continuous = cruise_speeds(task_of(speed=4.0, force=4.0, period=1.0, sensing="continuous"))
    assert continuous[0] == pytest.approx([4.0] * 3)
