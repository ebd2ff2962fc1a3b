"""The zero-order hold and disc sensing against analytical truths."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from mpc_cover.model.motion import path_extremes, roll_out
from mpc_cover.model.sensing import covered_at, look_counts, measured


@given(seed=st.integers(0, 10**6), period=st.floats(0.01, 2.0), steps=st.integers(1, 8))
def test_the_roll_out_is_the_matrix_exponential(seed, period, steps):
    rng = np.random.default_rng(seed)
    q, v = rng.normal(size=(1, 1)), rng.normal(size=(1, 1))
    force = rng.normal(size=(steps, 1, 1))
    # [q v u]' under u held constant (3.3)
    transition = expm(period * np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]))
    position, velocity = roll_out(q, v, force, period)
    state = np.array([q[0, 0], v[0, 0]])
    for n in range(steps):
        state = (transition @ [*state, force[n, 0, 0]])[:2]
        assert position[n + 1, 0, 0] == pytest.approx(state[0], abs=1e-9)
        assert velocity[n + 1, 0, 0] == pytest.approx(state[1], abs=1e-9)


def test_a_cell_exactly_at_the_radius_is_measured_and_one_beyond_is_not():
    cell = np.array([[0.3 + 0.6, 0.0], [0.91, 0.0]])
    assert measured(np.array([[0.3, 0.0]]), cell, np.array([[0.6]])).tolist() == [[True, False]]


def test_only_agents_that_can_measure_a_magnitude_do():
    seen = measured(np.zeros((2, 2)), np.zeros((1, 2)), np.array([[1.0, -np.inf], [-np.inf, -np.inf]]))
    assert seen.tolist() == [[True], [False]]


def test_a_lost_agent_sees_nothing():
    assert not measured(np.full((1, 2), np.nan), np.zeros((1, 2)), np.ones((1, 1))).any()


def test_a_cell_is_covered_when_its_last_magnitude_is():
    position = np.array([[[0.0, 0.0], [9.0, 0.0]], [[9.0, 0.0], [9.0, 0.0]], [[9.0, 0.0], [0.0, 0.0]]])
    radius = np.array([[1.0, -np.inf], [-np.inf, 1.0]])
    first = covered_at(np.array([0.0, 0.5, 1.0]), position, np.array([[0.0, 0.0], [5.0, 5.0]]), radius)
    assert first.tolist() == [1.0, np.inf]


def test_looks_count_once_a_period_for_each_agent():
    time = np.array([0.0, 0.2, 0.5, 1.0])
    here = np.zeros((4, 2, 2))
    cell, radius = np.zeros((1, 2)), np.ones((2, 1))
    assert covered_at(time, here, cell, radius, 2, 0.5).tolist() == [0.0]
    assert covered_at(time, here, cell, radius, 4, 0.5).tolist() == [0.5]
    assert covered_at(time, here, cell, radius, 6, 0.5).tolist() == [1.0]
    assert covered_at(time, here, cell, radius, 7, 0.5).tolist() == [np.inf]


@given(seed=st.integers(0, 10**6), period=st.floats(0.05, 1.0))
def test_the_extremes_of_a_path_are_those_of_a_dense_look(seed, period):
    rng = np.random.default_rng(seed)
    force = rng.normal(size=(3, 2, 2))
    position, velocity = roll_out(rng.normal(size=(2, 2)), rng.normal(size=(2, 2)), force, period)
    low, high = path_extremes(position, velocity, period)
    t = np.linspace(0.0, period, 400)[:, None, None, None]
    path = position[:-1] + t * velocity[:-1] + 0.5 * t**2 * force
    assert (low <= path.min(axis=0) + 1e-12).all()
    assert (high >= path.max(axis=0) - 1e-12).all()
    assert low == pytest.approx(path.min(axis=0), abs=1e-4)
    assert high == pytest.approx(path.max(axis=0), abs=1e-4)


def test_looks_of_a_motion_are_counted_agent_by_agent():
    rng = np.random.default_rng(2)
    position, cell = rng.uniform(0.0, 3.0, (7, 3, 2)), rng.uniform(0.0, 3.0, (20, 2))
    radius = np.array([[1.0, -np.inf], [0.5, 2.0], [-np.inf, 1.0]])
    expected = np.zeros((2, 20), dtype=int)
    for n, i, j, k in np.ndindex(7, 3, 2, 20):
        expected[j, k] += np.linalg.norm(position[n, i] - cell[k]) <= radius[i, j]
    np.testing.assert_array_equal(look_counts(position, cell, radius), expected)
