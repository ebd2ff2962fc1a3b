"""The tube holds whatever comes within the bounds, and is no larger than it must be."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpc_cover.mission.load import Mission, build_mission
from mpc_cover.model.tube import (
    DisturbanceBounds,
    Gains,
    Tube,
    closed_loop,
    gains_of,
    place_poles,
    tracking_of,
    tube,
    tube_of,
)

TYPICAL = DisturbanceBounds(position_noise_m=0.02, input_noise_m_per_s2=0.05, wind_m_per_s2=0.1, state_period_s=0.1)


def mission(**disturbance) -> Mission:
    raw = {
        "schema": 1,
        "name": "windy",
        "area": {"shape": {"kind": "box", "min_m": [0, 0], "max_m": [9, 9]}, "cell_size_m": 1},
        "fleet": {
            "defaults": {"sensing_radius_m": 1.0, "input_max_m_per_s2": 1.5, "speed_max_m_per_s": 1.5},
            "agents": [{"id": "a1", "start_m": [2, 2]}],
        },
        "disturbance": disturbance,
    }
    return build_mission(raw, "windy")


TYPICAL_MISSION = mission(position_noise_m=0.02, input_noise_m_per_s2=0.05, wind_m_per_s2=[0.06, 0.08])


def flown(bounds: DisturbanceBounds, gains: Gains, noise, gust, wind):
    """Return the largest |e_q|, |e_v|, |extra input| of errors driven by (samples, runs, d) noise and gusts."""
    h = bounds.state_period_s
    position = np.zeros(noise.shape[1:])
    velocity = np.zeros_like(position)
    largest = np.zeros(3)
    for n, g in zip(noise, gust, strict=True):
        force = -gains.position * (position + n) - gains.velocity * velocity + g + wind
        for part in (0.25, 0.5, 0.75, 1.0):
            q = position + part * h * velocity + 0.5 * (part * h) ** 2 * force
            v = velocity + part * h * force
            norms = [np.linalg.norm(x, axis=-1).max() for x in (q, v, force)]
            largest = np.maximum(largest, norms)
        position, velocity = q, v
    return largest


def as_array(size: Tube):
    return np.array([size.position_m, size.velocity_m_per_s, size.input_m_per_s2])


def in_balls(random, shape, radius):
    direction = random.standard_normal(shape)
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    return radius * direction * random.uniform(size=(*shape[:-1], 1)) ** (1.0 / shape[-1])


@pytest.mark.parametrize("dimension", [2, 3])
def test_ten_thousand_random_flights_stay_inside(dimension):
    random, gains = np.random.default_rng(1), gains_of(TYPICAL_MISSION)
    shape = (150, 10_000, dimension)
    noise = in_balls(random, shape, TYPICAL.position_noise_m)
    gust = in_balls(random, shape, TYPICAL.input_noise_m_per_s2)
    wind = in_balls(random, shape[1:], 0.0) + TYPICAL.wind_m_per_s2 * np.eye(dimension)[0]
    assert (flown(TYPICAL, gains, noise, gust, wind) <= as_array(tube(TYPICAL, gains))).all()


@pytest.mark.parametrize(
    "bounds", [TYPICAL, DisturbanceBounds(0.05, 0.0, 0.0, 0.1), DisturbanceBounds(0.0, 0.1, 0.4, 0.5)]
)
def test_extreme_disturbances_stay_inside(bounds):
    """All corners: constant ones, and those that change sides at every frequency."""
    gains = place_poles(0.6, 0.9, bounds.state_period_s)
    samples = np.arange(400)
    sides = [np.ones(400), *(np.sign(np.sin(2 * np.pi * samples / length + 1e-3)) for length in range(2, 120, 3))]
    corners = np.array([sign * side for side in sides for sign in (1.0, -1.0)]).T  # (400, runs)
    for relation in (1.0, -1.0):
        noise = bounds.position_noise_m * corners[..., None] * [1.0, 0.0]
        gust = relation * bounds.input_noise_m_per_s2 * corners[..., None] * [1.0, 0.0]
        for side in (1.0, -1.0):
            wind = np.array([side * bounds.wind_m_per_s2, 0.0])
            assert (flown(bounds, gains, noise, gust, wind) <= as_array(tube(bounds, gains)) * (1 + 1e-9)).all()


@pytest.mark.parametrize("row", [0, 1])
def test_the_worst_case_comes_as_near_as_rounding(row):
    """Against disturbances that are chosen with foresight the bound is attained: it is not loose."""
    gains = place_poles(0.6, 0.9, TYPICAL.state_period_s)
    matrix, entry = closed_loop(gains, TYPICAL.state_period_s)
    kernel = [np.linalg.matrix_power(matrix, j) @ entry for j in range(300)]
    sign = np.sign([state[row] for state in kernel][::-1])[:, None, None] * [1.0, 0.0]
    noise, gust = -TYPICAL.position_noise_m * sign, TYPICAL.input_noise_m_per_s2 * sign
    reached = flown(TYPICAL, gains, noise, gust, np.zeros(2))[row]
    calm = tube(DisturbanceBounds(0.02, 0.05, 0.0, 0.1), gains)
    assert reached <= as_array(calm)[row]
    assert reached >= 0.98 * as_array(calm)[row]


@settings(max_examples=40, deadline=None)
@given(st.floats(0, 0.1), st.floats(0, 0.3), st.floats(0, 0.3), st.sampled_from([0.05, 0.1, 0.5]), st.integers(0, 99))
def test_any_bounds(noise_m, gust, wind, period, seed):
    bounds, random = DisturbanceBounds(noise_m, gust, wind, period), np.random.default_rng(seed)
    gains = place_poles(0.7, 0.8, period)
    shape = (80, 20, 2)
    noise, push = in_balls(random, shape, noise_m), in_balls(random, shape, gust)
    size = as_array(tube(bounds, gains))
    assert (flown(bounds, gains, noise, push, np.array([0.0, wind])) <= size * (1 + 1e-9) + 1e-12).all()


def test_without_disturbances_there_is_no_tube():
    assert tube_of(mission()) == Tube(0.0, 0.0, 0.0)
    assert tube_of(mission(delay_s=0.3, slow_agents={"a1": 0.5})) == Tube(0.0, 0.0, 0.0)


def test_the_tube_grows_with_each_bound():
    sizes = [as_array(tube_of(mission(wind_m_per_s2=[wind, 0.0]))) for wind in (0.05, 0.1, 0.2)]
    assert all((small < large).all() for small, large in pairwise(sizes))


def test_gains_place_the_poles_where_they_are_asked_for():
    matrix, _ = closed_loop(place_poles(0.3, 0.8, 0.1), 0.1)
    np.testing.assert_allclose(sorted(np.linalg.eigvals(matrix).real), [0.3, 0.8], atol=1e-9)


def test_the_gains_of_a_mission_cost_less_than_others():
    best, others = (
        tube(TYPICAL, gains_of(TYPICAL_MISSION)),
        [tube(TYPICAL, place_poles(p, p, 0.1)) for p in (0.2, 0.5, 0.9)],
    )

    def cost(size):
        return (2 * size.position_m / 1.0) + size.velocity_m_per_s / 1.5 + size.input_m_per_s2 / 1.5

    assert all(cost(best) <= cost(other) for other in others)


def test_typical_bounds_leave_most_of_a_sensing_radius():
    """The figures in the documentation; a change of the gains is meant to show here."""
    size = tube_of(TYPICAL_MISSION)
    assert size.position_m == pytest.approx(0.0581, abs=1e-3)
    assert size.velocity_m_per_s == pytest.approx(0.0632, abs=1e-3)
    assert size.input_m_per_s2 == pytest.approx(0.504, abs=1e-2)


def test_what_is_measured_may_be_off_by_the_noise_as_well():
    tracking = tracking_of(TYPICAL_MISSION)
    inside = tracking.tube.position_m + 0.02
    still = np.zeros(2)
    assert tracking.contains(np.array([inside, 0.0]), still)
    assert not tracking.contains(np.array([inside + 0.0021, 0.0]), still)
    assert not tracking.contains(still, np.array([0.0, tracking.tube.velocity_m_per_s + 0.0021]))
