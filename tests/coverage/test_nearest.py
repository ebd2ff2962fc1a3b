"""Nearest samples, and distances."""

from __future__ import annotations

import numpy as np
import pytest

from mpc_cover.coverage.nearest import nearest_samples
from mpc_cover.coverage.nearest_points import pairwise_distance


def test_fewer_samples_than_asked_for_are_padded_with_never():
    position = np.array([[[0.0, 0.0], [1.0, 0.0]]])
    radius = np.array([[1.0, 1.0], [1.0, -np.inf]])
    nearest = nearest_samples(position, np.array([[2.0, 0.0]]), radius, np.ones((2, 1)), 6)
    assert nearest.sample.shape == (2, 6)
    assert np.sort(nearest.excess[0])[:2] == pytest.approx([0.0, 1.0])
    assert np.sort(nearest.excess[1])[1] > 1e8


def test_pairwise_distance_is_the_euclidean_one():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(5, 3)), rng.normal(size=(4, 3))
    assert pairwise_distance(a, b) == pytest.approx(np.linalg.norm(a[:, None] - b[None], axis=2))
