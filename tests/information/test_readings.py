"""Simulated readings are the same for whoever works them out, and as noisy as they should be."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from maps_fixtures import box_field, seeing

from mpc_cover.information.scalar_field import TimedReadings


def sensor(variance=1.0, agents=3, seed=5):
    sight = seeing(box_field(), agents)
    truth = np.linspace(-3.0, 3.0, sight.shape[1])[None]
    return TimedReadings(sight, truth, variance, seed), truth[0]


@given(seed=st.integers(0, 10**6), time_s=st.floats(0.0, 1e4))
def test_an_agent_alone_reads_what_it_reads_among_others(seed, time_s):
    readings, _ = sensor()
    position = np.random.default_rng(seed).uniform(0.0, 4.0, (3, 2))
    together = readings.looks(time_s, position)
    for agent in range(3):
        alone = readings.looks(time_s, position[[agent]], np.array([agent]))
        mine = together.where(together.agent == agent)
        np.testing.assert_array_equal(alone.place, mine.place)
        np.testing.assert_array_equal(alone.value, mine.value)


def test_another_time_agent_or_seed_reads_otherwise():
    position = np.full((1, 2), 2.0)

    def read(seed=5, time_s=1.0, agent=0):
        return sensor(seed=seed)[0].looks(time_s, position, np.array([agent])).value

    for other in (read(seed=6), read(time_s=1.5), read(agent=1)):
        assert not np.array_equal(read(), other)
    np.testing.assert_array_equal(read(), read(time_s=1.0 + 1e-9))


@pytest.mark.parametrize("variance", [1e-4, 0.04, 1.0, 25.0, 1e6])
def test_noise_has_the_variance_asked_for_and_few_digits(variance):
    readings, truth = sensor(variance)
    off = []
    for step in range(400):
        looks = readings.looks(0.5 * step, np.full((3, 2), 2.0))
        off.append(looks.value - truth[looks.place])
        scaled = looks.value / 10.0 ** np.floor(np.log10(np.sqrt(variance))) * 100.0
        np.testing.assert_allclose(scaled, np.round(scaled), atol=1e-6 * (1.0 + np.abs(scaled)).max())
    every = np.concatenate(off)
    assert every.var() == pytest.approx(variance, rel=0.06)
    assert abs(every.mean()) < 4.0 * np.sqrt(variance / every.size)
