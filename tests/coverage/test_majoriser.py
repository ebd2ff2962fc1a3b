"""The majoriser: an upper bound that touches, with the right slope and bend."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motions import grid, random_motion

from mpc_cover.coverage.majoriser import Softness, build_majoriser, soft_cost, soft_minimum


@given(seed=st.integers(0, 10**6), beta=st.floats(0.5, 50.0), count=st.integers(1, 8))
def test_the_soft_minimum_lies_at_most_log_m_over_beta_below_the_minimum(seed, beta, count):
    excess = np.random.default_rng(seed).uniform(-2.0, 8.0, (5, count))
    value, share = soft_minimum(excess, beta)
    least = excess.min(axis=1)
    assert (value <= least + 1e-12).all()
    assert (value >= least - np.log(count) / beta - 1e-12).all()
    assert share.sum(axis=1) == pytest.approx(np.ones(5))


@given(seed=st.integers(0, 10**6), beta=st.floats(0.5, 20.0))
def test_its_gradient_is_the_share_by_finite_differences(seed, beta):
    excess = np.random.default_rng(seed).uniform(-1.0, 3.0, (1, 4))
    _, share = soft_minimum(excess, beta)
    for j in range(4):
        step = np.zeros((1, 4))
        step[0, j] = 1e-6
        slope = (soft_minimum(excess + step, beta)[0] - soft_minimum(excess - step, beta)[0]) / 2e-6
        assert slope[0] == pytest.approx(share[0, j], abs=1e-6)


def exact_bound(majoriser, bar, moved, cell, radius):
    """Evaluate sum gamma pos(level + sum_n w_n (d_n - dbar_n)) with the true distances of a moved motion."""
    points, old = moved.reshape(-1, moved.shape[2]), bar.reshape(-1, bar.shape[2])
    p = np.tile(cell, (radius.shape[1], 1))
    share = np.linalg.norm(majoriser.slope, axis=2)
    new = np.linalg.norm(points[majoriser.sample] - p[:, None], axis=2)
    was = np.linalg.norm(old[majoriser.sample] - p[:, None], axis=2)
    return float(majoriser.weight @ np.maximum(majoriser.level + (share * (new - was)).sum(axis=1), 0.0))


@given(
    seed=st.integers(0, 10**6),
    size=st.floats(0.0, 4.0),
    beta=st.floats(0.5, 40.0),
    dimension=st.sampled_from([2, 3]),
    magnitudes=st.integers(1, 2),
)
def test_it_is_an_upper_bound_everywhere_and_tight_at_the_iterate(seed, size, beta, dimension, magnitudes):
    rng = np.random.default_rng(seed)
    bar, _ = random_motion(rng, 8, 2, dimension)
    cell, softness = grid(4, 2.1, dimension), Softness(beta, 0.1)
    radius = rng.uniform(0.5, 2.0, (2, magnitudes))
    weight = rng.uniform(0.1, 1.0, (magnitudes, cell.shape[0]))
    majoriser = build_majoriser(bar, cell, radius, weight, softness)
    assert majoriser.cost == pytest.approx(soft_cost(bar, cell, radius, weight, softness))
    assert exact_bound(majoriser, bar, bar, cell, radius) == pytest.approx(majoriser.cost)
    moved = bar + size * rng.normal(size=bar.shape)
    bound = exact_bound(majoriser, bar, moved, cell, radius)
    assert soft_cost(moved, cell, radius, weight, softness) <= bound + 1e-9


@given(seed=st.integers(0, 10**6), dimension=st.sampled_from([2, 3]))
def test_its_gradient_is_that_of_the_soft_cost_by_finite_differences(seed, dimension):
    rng = np.random.default_rng(seed)
    position, _ = random_motion(rng, 3, 2, dimension)
    cell = grid(3, 3.0, dimension) + 12.0  # far away: no kink of pos, and all of the few samples are nearest
    radius, weight = np.full((2, 1), 0.5), rng.uniform(0.5, 1.0, (1, cell.shape[0]))
    softness = Softness(1.5, 0.2, count=8)
    majoriser = build_majoriser(position, cell, radius, weight, softness)
    gradient = majoriser.gradient(majoriser.level > 0.0, 8)
    flat = position.reshape(8, dimension)
    for index in np.ndindex(flat.shape):
        step = np.zeros_like(flat)
        step[index] = 1e-5
        ahead, behind = (flat + step).reshape(position.shape), (flat - step).reshape(position.shape)
        slope = soft_cost(ahead, cell, radius, weight, softness) - soft_cost(behind, cell, radius, weight, softness)
        assert gradient[index] == pytest.approx(slope / 2e-5, abs=1e-5)


@given(seed=st.integers(0, 10**6), dimension=st.sampled_from([2, 3]))
def test_its_curvature_is_that_of_the_distances_by_finite_differences(seed, dimension):
    rng = np.random.default_rng(seed)
    position = rng.uniform(0.0, 1.0, (1, 1, dimension))
    cell = np.full((1, dimension), 3.0)
    majoriser = build_majoriser(position, cell, np.array([[0.5]]), np.array([[1.7]]), Softness(2.0, 0.0, count=1))
    block = majoriser.curvature(np.array([True]), 1)[0]
    step = 1e-4
    for a in range(dimension):
        for b in range(dimension):
            ea, eb = step * np.eye(dimension)[a], step * np.eye(dimension)[b]
            corners = [position[0, 0] + s * ea + t * eb - cell[0] for s, t in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
            d = [np.linalg.norm(c) for c in corners]
            assert block[a, b] == pytest.approx(1.7 * (d[0] - d[1] - d[2] + d[3]) / (4 * step**2), abs=1e-4)
    assert np.linalg.eigvalsh(block).min() >= -1e-12


def test_a_sample_on_top_of_a_cell_has_no_direction_and_no_nan():
    majoriser = build_majoriser(
        np.zeros((1, 1, 2)), np.zeros((1, 2)), np.array([[0.1]]), np.ones((1, 1)), Softness(1.0, 0.5, count=1)
    )
    assert np.isfinite(majoriser.slope).all()
    assert np.isfinite(majoriser.curvature(np.array([True]), 1)).all()
