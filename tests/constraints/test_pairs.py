"""Distances of pairs along the continuous path."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motions import PERIOD, random_motion

from mpc_cover.constraints.pairs import all_pairs, pair_distances


def dense(position, velocity, parts=200):
    """Return pair distances (N, pairs, parts+1) along the continuous path."""
    force = np.diff(velocity, axis=0) / PERIOD
    t = np.linspace(0.0, PERIOD, parts + 1)[:, None, None, None]
    path = position[:-1] + t * velocity[:-1] + 0.5 * t**2 * force
    first, second = all_pairs(position.shape[1])
    return np.linalg.norm(path[:, :, first] - path[:, :, second], axis=3).transpose(1, 2, 0)


@given(seed=st.integers(0, 10**6), agents=st.integers(2, 4), dimension=st.sampled_from([2, 3]))
def test_least_and_most_are_those_of_the_continuous_path(seed, agents, dimension):
    motion = random_motion(np.random.default_rng(seed), 5, agents, dimension)
    pairs, path = pair_distances(*motion, PERIOD), dense(*motion)
    assert (pairs.least >= path.min(axis=2) - 1e-9).all()
    assert pairs.least == pytest.approx(path.min(axis=2), abs=0.05)
    assert pairs.most == pytest.approx(path.max(axis=2), abs=0.05)
