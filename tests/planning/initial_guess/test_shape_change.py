"""A way from shape to shape keeps all pairs apart and all links in range, at every instant."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpc_cover.constraints.pairs import all_pairs
from mpc_cover.planning.initial_guess.shape_change import (
    Distances,
    chain_of,
    segment_distance,
    stretching,
    unfolding,
)

APART = 1.0


def block(columns, rows, spacing):
    return spacing * np.array([[i, j] for j in range(rows) for i in range(columns)], dtype=float)


def bounds(shape, reach):
    return Distances(np.full(len(all_pairs(len(shape))[0]), APART), reach)


def along_the_way(shapes):
    """Return (n, m, d) positions at many instants of straight legs."""
    part = np.linspace(0.0, 1.0, 41)[:, None, None]
    return np.concatenate([first + part * (last - first) for first, last in pairwise(shapes)])


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**31))
def test_the_least_distance_of_a_segment_is_that_of_its_points(seed):
    rng = np.random.default_rng(seed)
    first, last = rng.normal(size=(2, 5, 3))
    dense = first + np.linspace(0.0, 1.0, 2001)[:, None, None] * (last - first)
    np.testing.assert_allclose(segment_distance(first, last), np.linalg.norm(dense, axis=2).min(axis=0), atol=2e-3)


@pytest.mark.parametrize(("columns", "rows"), [(2, 1), (3, 1), (1, 4), (2, 2), (3, 2), (4, 3), (6, 4)])
@pytest.mark.parametrize("spacing", [1.02, 1.05, 1.2])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_block_unfolds_to_a_line_and_keeps_its_distances_on_the_way(columns, rows, spacing, axis):
    start, reach = block(columns, rows, spacing), spacing + 0.03
    chain = chain_of(start, reach, axis)
    assert sorted(chain) == list(range(len(start)))
    width = reach * (len(start) - 1)
    shapes = unfolding(start, chain, axis, width, reach, bounds(start, reach))
    np.testing.assert_allclose(np.ptp(shapes[-1], axis=0)[[axis, 1 - axis]], [width, 0.0], atol=1e-9)
    way = along_the_way([start, *shapes])
    one, two = all_pairs(len(start))
    assert np.linalg.norm(way[:, one] - way[:, two], axis=2).min() >= APART - 1e-6
    assert np.linalg.norm(np.diff(way[:, chain], axis=1), axis=2).max() <= reach + 1e-6


@pytest.mark.parametrize("room", [5.5, 9.0])
def test_it_unfolds_only_as_far_as_there_is_room(room):
    start, reach = block(4, 3, 1.05), 1.2
    shapes = unfolding(start, chain_of(start, reach, 0), 0, 20.0, reach, bounds(start, reach), room)
    assert room - 1e-6 <= np.ptp(shapes[-1][:, 0]) <= 1.1 * room


def test_a_star_is_no_chain():
    star = np.array([[0.0, 0.0], [1.1, 0.0], [-1.1, 0.0], [0.0, 1.1], [0.0, -1.1]])
    assert chain_of(star, 1.2, 0) is None


def test_a_chain_in_space_unfolds_too():
    start = 1.05 * np.array([[0, 0, 0], [0, 1, 0], [0, 1, 1], [1, 1, 1]], dtype=float)
    chain = chain_of(start, 1.2, 0)
    shapes = unfolding(start, chain, 0, 3.6, 1.2, bounds(start, 1.2))
    np.testing.assert_allclose(np.ptp(shapes[-1], axis=0), [3.6, 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize("width", [3.0, np.inf])
def test_a_star_is_stretched_as_far_as_its_links_allow(width):
    star = np.array([[0.0, 0.0], [1.1, 0.0], [-1.1, 0.0], [0.0, 1.1], [0.0, -1.1]])
    links = np.array([[0, 1], [0, 2], [0, 3], [0, 4]])
    wider = stretching(star, links, 0, width, bounds(star, 1.65))
    np.testing.assert_allclose(np.ptp(wider, axis=0), [min(width, 3.3), 2.2])
    assert stretching(star, links, 0, 2.0, bounds(star, 1.65)) is None
