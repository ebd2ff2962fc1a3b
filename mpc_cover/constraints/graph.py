"""Spanning trees of the communication graph (4.20), many graphs at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.pairs import all_pairs, linked_pairs

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.model.fleet_constraints import FleetConstraints


def minimum_spanning_trees(weight: FloatArray, agents: int) -> BoolArray:
    """Return (graphs, pairs): the edges of the minimum spanning tree of each complete graph.

    `weight` is (graphs, pairs) over `all_pairs(agents)`. Prim's algorithm on all graphs at once; ties go
    to the lower pair, a total order, so that the tree is unique.
    """
    graphs = weight.shape[0]
    tree = np.zeros(weight.shape, dtype=bool)
    if agents < 2:  # noqa: PLR2004 - no edge
        return tree
    first, second = all_pairs(agents)
    inside = np.zeros((graphs, agents), dtype=bool)
    inside[:, 0] = True
    every = np.arange(graphs)
    for _ in range(agents - 1):
        crossing = inside[:, first] != inside[:, second]
        edge = np.argmin(np.where(crossing, weight, np.inf), axis=1)
        tree[every, edge] = True
        inside[every, first[edge]] = True
        inside[every, second[edge]] = True
    return tree


def fleet_trees(weight: FloatArray, fleet: FleetConstraints) -> BoolArray:
    """Return (graphs, pairs): edges of the minimum spanning trees of the active agents, and the fleet's fixed links."""
    tree = np.zeros(weight.shape, dtype=bool)
    one, two = all_pairs(fleet.size)
    pair = np.flatnonzero(fleet.is_active[one] & fleet.is_active[two])
    tree[:, pair] = minimum_spanning_trees(weight[:, pair], len(fleet.active))
    tree[:, linked_pairs(fleet.size, fleet.links)] = True
    return tree


def bottleneck(weight: FloatArray, tree: BoolArray) -> FloatArray:
    """Return (graphs,): the longest edge of each tree [m], the least range that connects the fleet."""
    return np.asarray(np.where(tree, weight, 0.0).max(axis=1, initial=0.0))
