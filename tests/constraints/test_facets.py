"""Inscribed polytopes: inside the disc, and touching it where the iterate points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpc_cover.constraints.facets import inscribed, turned_normals


@given(
    seed=st.integers(0, 10**6),
    dimension=st.sampled_from([2, 3]),
    sides=st.sampled_from([4, 8, 16]),
    radius=st.floats(0.1, 9),
)
def test_points_of_the_polytope_lie_in_the_ball(seed, dimension, sides, radius):
    rng = np.random.default_rng(seed)
    facets = inscribed(dimension, sides)
    normal = turned_normals(facets, rng.normal(size=dimension))
    points = rng.normal(size=(200, dimension))
    # scale each point onto the polytope's surface
    points *= (facets.shrink * radius / np.abs(points @ normal.T).max(axis=1))[:, None]
    assert np.linalg.norm(points, axis=1).max() <= radius * (1 + 1e-9)


@given(seed=st.integers(0, 10**6), dimension=st.sampled_from([2, 3]))
def test_the_iterate_itself_is_inside_right_up_to_the_ball(seed, dimension):
    direction = np.random.default_rng(seed).normal(size=dimension)
    facets = inscribed(dimension, 8)
    normal = turned_normals(facets, direction)
    unit = direction / np.linalg.norm(direction)
    assert np.abs(normal @ unit).max() <= facets.shrink * (1 + 1e-9)


def test_a_regular_polygon_shrinks_by_the_cosine_of_half_its_angle():
    assert inscribed(2, 8).shrink == pytest.approx(np.cos(np.pi / 8))
    assert len(inscribed(2, 8).normal) == 4


def test_a_zero_direction_leaves_the_polytope_as_it_is():
    facets = inscribed(2, 8)
    assert turned_normals(facets, np.zeros(2)) == pytest.approx(facets.normal)


def test_26_facets_fill_most_of_the_ball():
    assert 0.85 < inscribed(3, 26).shrink < 1.0
