"""Disturbances keep their bounds, and come again with the same seed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpc_cover.mission.config import Disturbance
from mpc_cover.model.disturbance import AgentDisturbance, disturbs_motion, sample_ball, saturated_acceleration


def weather(seed=(0, 0), dimension=2, **given_):
    return AgentDisturbance(Disturbance(**given_), dimension, np.inf, seed)


@pytest.mark.parametrize("dimension", [2, 3])
def test_draws_fill_the_ball_evenly(dimension):
    random = np.random.default_rng(0)
    draws = np.array([sample_ball(random, 0.1, dimension) for _ in range(4000)])
    radius = np.linalg.norm(draws, axis=1)
    assert radius.max() <= 0.1
    assert np.abs(draws.mean(axis=0)).max() < 0.005
    inner = (radius < 0.05).mean()
    assert inner == pytest.approx(0.5**dimension, abs=0.03)


def test_the_same_seed_gives_the_same_weather_and_each_agent_its_own():
    def draws(seed):
        agent = weather(seed, position_noise_m=0.1, input_noise_m_per_s2=0.2)
        return [np.concatenate([agent.noise(), agent.gust()]) for _ in range(5)]

    np.testing.assert_array_equal(draws((3, 1)), draws((3, 1)))
    assert not np.array_equal(draws((3, 1)), draws((3, 2)))
    assert not np.array_equal(draws((3, 1)), draws((4, 0)))


def test_without_bounds_there_is_none():
    calm = weather()
    assert not np.any([calm.noise(), calm.gust(), calm.wind])


@pytest.mark.parametrize(
    ("given_", "expected"),
    [
        ({}, False),
        ({"delay_s": 0.4}, False),
        ({"wind_m_per_s2": (0.0, 0.0)}, False),
        ({"slow_agents": {"a1": 1.0}}, False),
        ({"slow_agents": {"a1": 0.9}}, True),
        ({"position_noise_m": 0.01}, True),
        ({"input_noise_m_per_s2": 0.01}, True),
        ({"wind_m_per_s2": (0.0, -0.1)}, True),
    ],
)
def test_what_makes_agents_stray(given_, expected):
    assert disturbs_motion(Disturbance(**given_)) is expected


pairs = st.tuples(st.floats(-2, 2), st.floats(-2, 2)).map(np.array)


@given(pairs, pairs, st.floats(1e-3, 1.0), st.floats(0.1, 1.5))
def test_a_slow_agent_keeps_its_speed_and_asks_for_no_more_input(velocity, force, duration, speed_max):
    velocity = velocity * min(1.0, speed_max / max(np.linalg.norm(velocity), 1e-9))
    real = saturated_acceleration(velocity, force, duration, speed_max)
    assert np.linalg.norm(real) <= np.linalg.norm(force) * (1 + 1e-9) + 1e-9
    for part in (0.3, 0.7, 1.0):
        assert np.linalg.norm(velocity + part * duration * real) <= speed_max * (1 + 1e-9)


def test_within_its_speed_nothing_changes():
    force = np.array([0.3, -0.2])
    assert saturated_acceleration(np.zeros(2), force, 0.1, 1.0) is force
    assert saturated_acceleration(np.zeros(2), force, 0.1, np.inf) is force
