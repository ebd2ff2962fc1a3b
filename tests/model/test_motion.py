"""The zero-order hold against analytical truths."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from mpc_cover.model.motion import path_extremes, roll_out, time_from_rest


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


def test_the_least_time_from_rest_is_that_of_accelerating_then_cruising():
    time = time_from_rest(np.array([0.0, 0.5, 0.75, 3.0]), 1.5, 1.5)
    np.testing.assert_allclose(time, [0.0, np.sqrt(2.0 / 3.0), 1.0, 0.5 + 2.0])
