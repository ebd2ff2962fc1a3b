"""Separation and connectivity: what their rows allow is safe between samples too."""

from __future__ import annotations

import numpy as np
import pytest
from flights import fleet_of
from hypothesis import given
from hypothesis import strategies as st
from motions import PERIOD, random_motion, replace
from scipy.sparse.csgraph import minimum_spanning_tree

from mpc_cover.constraints.collision import collision_rows
from mpc_cover.constraints.connectivity import connectivity_rows
from mpc_cover.constraints.facets import inscribed
from mpc_cover.constraints.graph import bottleneck, fleet_trees, minimum_spanning_trees
from mpc_cover.constraints.pairs import all_pairs, linked_pairs, pair_distances
from mpc_cover.constraints.rows import Layout, stack


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


@given(seed=st.integers(0, 10**6), dimension=st.sampled_from([2, 3]))
def test_ends_that_satisfy_the_collision_rows_are_separated_at_every_instant_between(seed, dimension):
    """Any two ends on the right side, any relative input up to the bound: the whole interval is apart."""
    rng = np.random.default_rng(seed)
    bar = random_motion(rng, 1, 2, dimension)
    pairs, layout = pair_distances(*bar, PERIOD), Layout(1, 2, dimension)
    if pairs.least.min() < 0.7:
        return
    relative = 3.0 * rng.normal(size=dimension) / np.sqrt(dimension)
    between = np.array([np.linalg.norm(relative) * PERIOD**2 / 8])
    rows = collision_rows(layout, pairs, np.array([0.5]), between, reach=100.0)
    normal, wanted = -rows.value[:dimension], min(0.5 + between[0], -rows.upper[0])
    ends = rng.normal(scale=3.0, size=(2, dimension))
    ends += np.maximum(wanted - ends @ normal, 0.0)[:, None] * normal
    t = np.linspace(0.0, 1.0, 400)[:, None]
    path = (1 - t) * ends[0] + t * ends[1] - 0.5 * PERIOD**2 * t * (1 - t) * relative
    if wanted == pytest.approx(0.5 + between[0]):
        assert np.linalg.norm(path, axis=1).min() >= 0.5 - 1e-9


def test_an_iterate_that_is_too_near_is_asked_for_what_is_required_and_no_more():
    still = np.repeat(np.array([[[0.0, 0.0], [0.3, 0.0]]]), 2, axis=0)
    pairs = pair_distances(still, np.zeros_like(still), PERIOD)
    rows = collision_rows(Layout(1, 2, 2), pairs, np.array([0.5]), np.array([0.1]), reach=1.0)
    assert rows.upper.tolist() == [-0.5]
    assert rows.slacks == 1


def test_pairs_that_cannot_meet_within_the_trust_region_have_no_row():
    still = np.repeat(np.array([[[0.0, 0.0], [9.0, 0.0]]]), 2, axis=0)
    pairs = pair_distances(still, np.zeros_like(still), PERIOD)
    assert collision_rows(Layout(1, 2, 2), pairs, np.array([0.5]), np.array([0.1]), reach=1.0).count == 0


@given(seed=st.integers(0, 10**6), agents=st.integers(2, 5), dimension=st.sampled_from([2, 3]))
def test_the_iterate_satisfies_its_own_rows_whenever_it_satisfies_the_constraints(seed, agents, dimension):
    bar = random_motion(np.random.default_rng(seed), 5, agents, dimension)
    layout, pairs = Layout(5, agents, dimension), pair_distances(*bar, PERIOD)
    x = np.concatenate([bar[0].ravel(), bar[1].ravel()])
    longest = bottleneck(pairs.most, minimum_spanning_trees(pairs.most, agents)).max()
    rows = connectivity_rows(
        layout, pairs, longest + 1e-9, 0.1, 100.0, inscribed(dimension, 16), fleet=fleet_of(bar[0][0])
    )
    matrix, _, upper = stack([rows], layout.size)
    assert (matrix @ x <= upper + 1e-9).all()


@given(seed=st.integers(0, 10**6), agents=st.integers(2, 5))
def test_motions_that_satisfy_the_connectivity_rows_are_connected_at_the_samples(seed, agents):
    rng = np.random.default_rng(seed)
    bar = random_motion(rng, 4, agents)
    layout, pairs = Layout(4, agents, 2), pair_distances(*bar, PERIOD)
    allowed = float(bottleneck(pairs.most, minimum_spanning_trees(pairs.most, agents)).max()) + 0.2
    rows = connectivity_rows(layout, pairs, allowed, 0.0, 100.0, inscribed(2, 16), fleet=fleet_of(bar[0][0]))
    matrix, _, upper = stack([rows], layout.size)
    moved = bar[0] + rng.normal(scale=0.2, size=bar[0].shape)
    moved[0] = bar[0][0]
    if (matrix @ np.concatenate([moved.ravel(), np.zeros(layout.half)]) <= upper).all():
        first, second = all_pairs(agents)
        length = np.linalg.norm(moved[:, first] - moved[:, second], axis=2)
        assert bottleneck(length, minimum_spanning_trees(length, agents)).max() <= allowed + 1e-9


@given(seed=st.integers(0, 10**6), agents=st.integers(1, 7))
def test_the_trees_are_those_of_scipy(seed, agents):
    weight = np.random.default_rng(seed).uniform(0.1, 9.0, (4, agents * (agents - 1) // 2))
    tree = minimum_spanning_trees(weight, agents)
    first, second = all_pairs(agents)
    for row, mine in zip(weight, tree, strict=True):
        full = np.zeros((agents, agents))
        full[first, second] = row
        theirs = minimum_spanning_tree(full).toarray()
        assert row[mine].sum() == pytest.approx(theirs.sum())
        assert mine.sum() == agents - 1


def test_links_are_kept_whatever_the_tree():
    """Fixed topology (4.19): the long edge of a triangle is in no tree, but it is a link."""
    still = np.repeat(np.array([[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]]), 2, axis=0)
    pairs, layout = pair_distances(still, np.zeros_like(still), PERIOD), Layout(1, 3, 2)
    facets = inscribed(2, 8)
    fleet = fleet_of(still[0])
    without = connectivity_rows(layout, pairs, 2.5, 0.0, 0.1, facets, fleet=fleet)
    linked = connectivity_rows(layout, pairs, 2.0, 0.0, 0.1, facets, fleet=replace(fleet, links=((2, 0),)))
    assert without.count == 0
    assert linked.count > 0
    assert linked_pairs(3, ((2, 0), (0, 1))).tolist() == [0, 1]


def test_the_tree_of_a_fleet_leaves_the_lost_out():
    fleet = replace(fleet_of(np.zeros((3, 2))), lost=(1,))
    tree = fleet_trees(np.array([[1.0, 5.0, 1.0]]), fleet)
    assert tree.tolist() == [[False, True, False]]


def test_ties_go_to_the_lower_pair():
    tree = minimum_spanning_trees(np.ones((1, 3)), 3)
    assert tree.tolist() == [[True, True, False]]
