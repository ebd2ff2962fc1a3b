"""Spanning trees: those of SciPy, without the lost."""

from __future__ import annotations

import numpy as np
import pytest
from flights import fleet_of
from hypothesis import given
from hypothesis import strategies as st
from motions import replace
from scipy.sparse.csgraph import minimum_spanning_tree

from mpc_cover.constraints.graph import fleet_trees, minimum_spanning_trees
from mpc_cover.constraints.pairs import all_pairs


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


def test_the_tree_of_a_fleet_leaves_the_lost_out():
    fleet = replace(fleet_of(np.zeros((3, 2))), lost=(1,))
    tree = fleet_trees(np.array([[1.0, 5.0, 1.0]]), fleet)
    assert tree.tolist() == [[False, True, False]]


def test_ties_go_to_the_lower_pair():
    tree = minimum_spanning_trees(np.ones((1, 3)), 3)
    assert tree.tolist() == [[True, True, False]]
