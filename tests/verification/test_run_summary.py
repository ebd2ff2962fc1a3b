"""A run in figures: nothing is rounded in its own favour."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from flights import box3_flight, mission_of, propagate, trajectory_of

from mpc_cover.mission.load import load_mission
from mpc_cover.verification.check import check_trajectory
from mpc_cover.verification.path import Path
from mpc_cover.verification.summary import (
    distance_travelled,
    floor_percent,
    summarise,
    summarise_steps,
    time_to_cover,
)


@pytest.fixture(scope="module")
def flight():
    return box3_flight()


@pytest.mark.parametrize(
    ("part", "whole", "shown"),
    [(0, 400, 0.0), (400, 400, 100.0), (99_996, 100_000, 99.99), (2499, 2500, 99.96), (2, 3, 66.66), (57, 100, 57.0)],
)
def test_percent_never_rounds_up(part, whole, shown):
    assert floor_percent(part, whole) == shown
    assert floor_percent(part, whole, decimals=0) == float(100 * part // whole)


def test_summary_of_the_flight(flight):
    summary = summarise(flight, check_trajectory(flight))
    assert summary.holds
    assert summary.violations == ()
    assert (summary.mission, summary.kind, summary.cells, summary.covered_cells) == ("box-3", "simulate", 400, 394)
    assert summary.covered_percent == 98.5
    assert summary.time_to_90_s == 21.0
    assert summary.time_to_95_s == 21.5
    assert summary.time_to_99_s is None
    assert summary.time_to_100_s is None
    assert summary.duration_s == 22.5
    assert summary.largest_speed_m_per_s == pytest.approx(4 / 3)
    assert summary.largest_input_m_per_s2 == pytest.approx(4 / 3)
    assert (summary.speed_max_m_per_s, summary.input_max_m_per_s2) == (1.5, 1.5)
    assert summary.connected is True
    assert summary.bottleneck_m == pytest.approx(np.sqrt(5.0))
    assert summary.communication_range_m == 5.5
    assert 1.29 < summary.smallest_separation_m < 1.30
    assert summary.swath_bound_s == pytest.approx((100 - 3 * np.pi) / 9)
    assert summary.ratio_to_bound is None
    # straight legs, so the distances are the legs' lengths
    assert summary.distance_m["a1"] == pytest.approx(np.sqrt(2.0) + 8.0 + 4.6 + 8.0)
    assert summary.distance_total_m == pytest.approx(sum(summary.distance_m.values()))
    assert summary.step_times is None


def test_summary_is_json(flight):
    summary = summarise(flight, check_trajectory(flight), np.array([0.1, 0.2]))
    data = json.loads(json.dumps(summary.to_dict(), allow_nan=False))
    assert data["covered_percent"] == 98.5
    assert data["step_times"]["steps"] == 2
    assert data["violations"] == []


def test_violations_are_listed(flight):
    position = flight.position.copy()
    position[3, 0, 0] += 1.0
    bad = replace(flight, position=position)
    summary = summarise(bad, check_trajectory(bad))
    assert not summary.holds
    assert any(text.startswith("dynamics of position: FAILS") for text in summary.violations)


def test_separation_is_that_of_the_continuous_path():
    mission = load_mission("box-3")
    flight = trajectory_of(mission, np.zeros((2, 3, 2)))
    time = np.array([0.0, 1.0, 2.0])
    start = np.array([[0.0, 0.0], [3.0, 0.4], [9.0, 9.0]])
    speed = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 0.0]])
    position, velocity = propagate(start, flight.input, time, speed)
    summary = summarise(replace(flight, time=time, position=position, velocity=velocity), check_trajectory(flight))
    assert summary.smallest_separation_m == pytest.approx(0.4)
    assert summary.connected is False


def test_time_to_cover_counts_cells_exactly(flight):
    def covered(times):
        return replace(flight, covered_at=np.array(times, dtype=float))

    ten = [*range(1, 10), np.inf]
    assert time_to_cover(covered(ten), 90) == 9.0
    assert time_to_cover(covered(ten), 91) is None
    assert time_to_cover(covered([*range(1, 10), 99]), 95) == 99.0
    assert time_to_cover(covered([5.0]), 90) == 5.0
    assert time_to_cover(covered([3.0] * 199 + [np.inf]), 99) == 3.0


def test_a_single_agent_has_neither_separation_nor_bottleneck():
    raw = json.loads(load_mission("box-3").to_json())
    raw["fleet"]["agents"] = raw["fleet"]["agents"][:1]
    flight = trajectory_of(mission_of(raw), np.zeros((2, 1, 2)))
    summary = summarise(flight, check_trajectory(flight))
    assert summary.smallest_separation_m is None
    assert summary.bottleneck_m is None
    assert summary.connected is None


def test_without_a_range_connectivity_is_not_judged():
    raw = json.loads(load_mission("box-3").to_json())
    del raw["fleet"]["communication_range_m"]
    flight = trajectory_of(mission_of(raw), np.zeros((2, 3, 2)))
    summary = summarise(flight, check_trajectory(flight))
    assert summary.connected is None
    assert summary.communication_range_m is None
    assert summary.bottleneck_m == pytest.approx(np.sqrt(5.0))


def test_distance_along_a_curve_is_its_length():
    # thrown sideways at 1 m/s under 1 m/s^2 for 2 s: the arc length of a parabola
    time, force = np.array([0.0, 2.0]), np.array([[[0.0, -1.0]]])
    start, speed = np.zeros((1, 2)), np.array([[1.0, 0.0]])
    position, velocity = propagate(start, force, time, speed)
    length = 0.5 * (2.0 * np.sqrt(5.0) + np.arcsinh(2.0))
    assert distance_travelled(Path(time, position, velocity, force))[0] == pytest.approx(length, rel=1e-6)


def test_step_times():
    steps = summarise_steps(np.array([0.01] * 98 + [0.4, 0.6]), period_s=0.5)
    assert steps is not None
    assert (steps.steps, steps.misses, steps.period_ms) == (100, 1, 500.0)
    assert steps.p50_ms == pytest.approx(10.0)
    assert steps.max_ms == pytest.approx(600.0)
    assert 400.0 < steps.p99_ms <= 600.0
    assert summarise_steps(None, 0.5) is None
    assert summarise_steps(np.array([]), 0.5) is None


@pytest.mark.parametrize(("speed", "misses"), [(1.0, 0), (4.0, 1), (8.0, 2), ("fast", 0), (0.0, 0)])
def test_a_faster_clock_leaves_less_time_for_a_step(speed, misses):
    flight = box3_flight()
    flight = replace(flight, meta={**flight.meta, "speed": speed})
    steps = summarise(flight, check_trajectory(flight), np.array([0.1, 0.2])).step_times
    assert steps.misses == misses
    if misses:
        assert steps.period_ms == 500.0 / speed
