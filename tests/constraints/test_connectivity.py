"""Connectivity: what the rows allow is connected."""

from __future__ import annotations

import numpy as np
from flights import fleet_of
from hypothesis import given
from hypothesis import strategies as st
from motions import PERIOD, random_motion, replace

from mpc_cover.constraints.connectivity import connectivity_rows
from mpc_cover.constraints.facets import inscribed
from mpc_cover.constraints.graph import bottleneck, minimum_spanning_trees
from mpc_cover.constraints.pairs import all_pairs, linked_pairs, pair_distances
from mpc_cover.constraints.rows import Layout, stack


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
