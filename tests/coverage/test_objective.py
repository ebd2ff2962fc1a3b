"""The exact objective against analytical truths and brute force."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motions import grid, random_motion

from mpc_cover.coverage.nearest import nearest_samples
from mpc_cover.coverage.objective import coverage_cost


def test_one_sample_and_one_cell_cost_their_distance_less_the_radius():
    position, cell = np.array([[[0.0, 0.0]]]), np.array([[3.0, 4.0], [0.5, 0.0]])
    assert coverage_cost(position, cell, np.array([[1.0]]), np.ones((1, 2))) == pytest.approx(4.0)


def test_a_weight_scales_its_cell_and_zero_drops_it():
    position, cell = np.array([[[0.0, 0.0]]]), np.array([[3.0, 4.0], [0.0, 3.0]])
    assert coverage_cost(position, cell, np.array([[1.0]]), np.array([[2.0, 0.0]])) == pytest.approx(8.0)


def test_with_unequal_radii_the_minimum_runs_over_distance_less_radius():
    """The nearer sensor has the smaller radius: the erratum of (4.30)."""
    position = np.array([[[2.0, 0.0], [5.0, 0.0]]])
    cost = coverage_cost(position, np.zeros((1, 2)), np.array([[1.0], [4.5]]), np.ones((1, 1)))
    assert cost == pytest.approx(0.5)


def test_a_magnitude_counts_only_the_agents_that_can_measure_it():
    position = np.array([[[0.0, 0.0], [4.0, 0.0]]])
    radius = np.array([[1.0, -np.inf], [-np.inf, 1.0]])
    assert coverage_cost(position, np.zeros((1, 2)), radius, np.ones((2, 1))) == pytest.approx(3.0)


@given(seed=st.integers(0, 10**6), dimension=st.sampled_from([2, 3]), magnitudes=st.integers(1, 3))
def test_it_equals_brute_force(seed, dimension, magnitudes):
    rng = np.random.default_rng(seed)
    position, _ = random_motion(rng, 4, 3, dimension)
    cell = grid(4, 2.0, dimension)
    radius = np.where(rng.random((3, magnitudes)) < 0.3, -np.inf, rng.uniform(0.3, 2.0, (3, magnitudes)))
    radius[rng.integers(3)] = 0.7
    weight = rng.uniform(-0.5, 1.0, (magnitudes, cell.shape[0])).clip(0.0)
    expected = 0.0
    for j in range(magnitudes):
        for k, p in enumerate(cell):
            best = min(np.linalg.norm(q - p) - radius[i, j] for sample in position for i, q in enumerate(sample))
            expected += weight[j, k] * max(best, 0.0)
    assert coverage_cost(position, cell, radius, weight) == pytest.approx(expected)


@given(seed=st.integers(0, 10**6), most=st.integers(1, 5))
def test_several_looks_cost_the_sum_of_the_smallest_excesses(seed, most):
    rng = np.random.default_rng(seed)
    position, _ = random_motion(rng, 3, 2)
    cell, radius = grid(4, 2.0), np.array([[0.5], [1.0]])
    looks = rng.integers(1, most + 1, (1, 16))
    weight = rng.uniform(0.5, 1.0, (1, 16))
    excess = np.linalg.norm(position.reshape(-1, 2)[None] - cell[:, None], axis=2) - np.tile([0.5, 1.0], 4)
    ranked = np.maximum(np.sort(excess, axis=1), 0.0)
    expected = sum(weight[0, k] * ranked[k, : looks[0, k]].sum() for k in range(16))
    assert coverage_cost(position, cell, radius, weight, looks) == pytest.approx(expected)


def test_looks_at_one_cell_share_no_sample():
    position, _ = random_motion(np.random.default_rng(1), 9, 2)
    nearest = nearest_samples(position, grid(2), np.ones((2, 1)), np.ones((1, 4)), 3, np.full((1, 4), 4))
    for k in range(4):
        used = nearest.sample[nearest.cell == k].ravel()
        assert used.size == len(set(used)) == 12
