"""Every gradient against finite differences, and the errata: what the thesis's formulas should have been."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpc_cover.distributed.potential_functions import (
    Coordination,
    CoverageShape,
    collision_gradient,
    collision_potential,
    connectivity_gradient,
    connectivity_potential,
    coverage_gradient,
    coverage_potential,
    pair_directions,
)

BOUNDS = Coordination(separation_m=0.5, repel_within_m=1.5, range_m=4.0, attract_beyond_m=2.0)
seeds = given(seed=st.integers(0, 10**6), dimension=st.sampled_from([2, 3]))


def differences(value, position, step=1e-6):
    """Return the central differences of a scalar function of (m, d) positions."""
    gradient = np.empty_like(position)
    for index in np.ndindex(position.shape):
        moved = np.zeros_like(position)
        moved[index] = step
        gradient[index] = (value(position + moved) - value(position - moved)) / (2.0 * step)
    return gradient


def away_from(kinks, length):
    return all(np.abs(length - kink).min() > 1e-3 for kink in kinks)


@seeds
def test_coverage_gradient(seed, dimension):
    rng = np.random.default_rng(seed)
    shape = CoverageShape(alpha=float(rng.uniform(1.1, 5.0)), core_m=float(rng.uniform(0.2, 0.8)))
    position, cell = rng.uniform(0, 4, (3, dimension)), rng.uniform(0, 4, (20, dimension))
    weight = np.maximum(rng.normal(size=(3, 20)), 0.0)
    if not away_from([shape.core_m], np.linalg.norm(position[:, None] - cell, axis=2)):
        return
    numeric = differences(lambda q: coverage_potential(q, cell, weight, shape).sum(), position)
    gradient = coverage_gradient(position, cell, weight, shape)
    # what the differences lose by cancellation is a part of the potential itself
    lost = 1e-9 * coverage_potential(position, cell, weight, shape).sum()
    np.testing.assert_allclose(gradient, numeric, rtol=1e-5, atol=lost + 1e-6 * np.abs(gradient).max())


@seeds
def test_collision_gradient(seed, dimension):
    rng = np.random.default_rng(seed)
    position = rng.uniform(0, 3, (4, dimension))
    length = pair_directions(position)[1][np.triu_indices(4, 1)]
    if length.min() < 0.55 or not away_from([0.5, 1.5], length):
        return
    # each pair once: its gradient by q_i is what agent i is pushed by
    numeric = differences(lambda q: 0.5 * collision_potential(q, BOUNDS).sum(), position)
    np.testing.assert_allclose(collision_gradient(position, BOUNDS), numeric, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(numeric.sum(axis=0), 0.0, atol=1e-4)


@seeds
def test_connectivity_gradient(seed, dimension):
    rng = np.random.default_rng(seed)
    position = rng.uniform(0, 3, (4, dimension))
    kept = rng.random((4, 4)) < 0.6
    kept = (kept | kept.T) & ~np.eye(4, dtype=bool)
    length = pair_directions(position)[1][np.triu_indices(4, 1)]
    if length.max() > 3.95 or not away_from([2.0], length):
        return
    numeric = differences(lambda q: 0.5 * connectivity_potential(q, kept, BOUNDS).sum(), position)
    gradient = connectivity_gradient(position, kept, BOUNDS)
    np.testing.assert_allclose(gradient, numeric, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(gradient.sum(axis=0), 0.0, atol=1e-9)


def test_coverage_potential_is_zero_in_the_core_and_positive_outside():
    shape = CoverageShape(alpha=2.0, core_m=0.5)
    position = np.array([[0.1, 0.0], [0.5, 0.0], [1.0, 0.0], [1e6, 0.0]])
    value = coverage_potential(position, np.zeros((1, 2)), np.ones(1), shape)
    np.testing.assert_allclose(value, [0.0, 0.0, 4.0 - 1.0, 4.0], atol=1e-9)
    gradient = coverage_gradient(position, np.zeros((1, 2)), np.ones(1), shape)
    np.testing.assert_allclose(gradient[2], [2.0, 0.0])  # alpha (q - p) / |q - p|^(alpha + 2)
    assert (gradient[:2] == 0.0).all()


def test_nothing_owed_nothing_felt():
    shape = CoverageShape()
    assert (coverage_gradient(np.ones((2, 2)), np.zeros((3, 2)), np.zeros(3), shape) == 0.0).all()
    assert (coverage_potential(np.ones((2, 2)), np.zeros((3, 2)), np.zeros(3), shape) == 0.0).all()


def test_a_shared_map_is_everyones_own():
    rng = np.random.default_rng(0)
    position, cell, weight = rng.uniform(0, 5, (3, 2)), rng.uniform(0, 5, (9, 2)), rng.random(9)
    shared = coverage_gradient(position, cell, weight, CoverageShape())
    own = coverage_gradient(position, cell, np.tile(weight, (3, 1)), CoverageShape())
    np.testing.assert_allclose(shared, own)


@seeds
def test_no_local_minimum_off_the_cores(seed, dimension):
    """The Laplacian is negative (the lemma 5.3.1): somewhere on any small sphere the potential is lower."""
    rng = np.random.default_rng(seed)
    shape = CoverageShape(alpha=float(rng.uniform(1.2, 5.0)), core_m=0.2)
    cell = rng.uniform(0, 4, (15, dimension))
    point = rng.uniform(0, 4, (1, dimension))
    if np.linalg.norm(point - cell, axis=1).min() < 0.4:
        return
    step = 1e-3
    around = np.concatenate([point + sign * step * axis for axis in np.eye(dimension) for sign in (1.0, -1.0)])
    value = coverage_potential(around, cell, np.ones(15), shape)
    assert value.mean() < coverage_potential(point, cell, np.ones(15), shape)[0]


def test_potentials_explode_at_their_bounds_and_vanish_before():
    at = lambda length: np.array([[0.0, 0.0], [length, 0.0]])  # noqa: E731
    kept = ~np.eye(2, dtype=bool)
    assert collision_potential(at(0.5), BOUNDS)[0, 1] == np.inf
    assert collision_potential(at(0.3), BOUNDS)[0, 1] == np.inf
    assert collision_potential(at(1.5), BOUNDS)[0, 1] == 0.0
    assert collision_potential(at(1.0), BOUNDS)[0, 1] == pytest.approx(1.0)
    assert connectivity_potential(at(4.0), kept, BOUNDS)[0, 1] == np.inf
    assert connectivity_potential(at(2.0), kept, BOUNDS)[0, 1] == 0.0
    assert connectivity_potential(at(3.0), kept, BOUNDS)[0, 1] == pytest.approx(1.0)
    assert connectivity_potential(at(3.0), ~kept, BOUNDS)[0, 1] == 0.0
    for length in (0.0, 0.2, 0.5, 0.5 + 1e-7):
        gradient = collision_gradient(at(length), BOUNDS)
        assert np.isfinite(gradient).all()
        assert np.abs(gradient).max() > 1e6
        assert gradient[0, 0] > 0.0 or length == 0.0, "uphill is towards each other"
    assert (connectivity_gradient(at(4.5), kept, BOUNDS)[:, 0] * [-1.0, 1.0] > 1e6).all()


def test_two_on_one_spot_part():
    gradient = collision_gradient(np.zeros((2, 2)), BOUNDS)
    assert gradient[0, 0] * gradient[1, 0] < 0.0


def test_no_bounds_no_forces():
    free = Coordination()
    position = np.zeros((3, 2))
    assert (collision_gradient(position, free) == 0.0).all()
    assert (connectivity_gradient(position, np.ones((3, 3), dtype=bool), free) == 0.0).all()
    assert (connectivity_potential(position, np.ones((3, 3), dtype=bool), free) == 0.0).all()


@pytest.mark.parametrize(
    "values",
    [(0.5, 0.4, 5.0, 4.0), (0.5, 1.0, 0.4, 0.3), (0.5, 1.0, 5.0, 5.0), (-1.0, 1.0, 5.0, 4.0), (0.5, 6.0, 5.5, 4.0)],
)
def test_bounds_that_contradict_each_other(values):
    with pytest.raises(ValueError, match="rho_B < R_B"):
        Coordination(*values)


@pytest.mark.parametrize(("alpha", "core"), [(1.0, 0.5), (np.nan, 0.5), (3.0, 0.0), (3.0, np.inf)])
def test_a_shape_that_makes_no_sense(alpha, core):
    with pytest.raises(ValueError, match="coverage potential"):
        CoverageShape(alpha, core)
