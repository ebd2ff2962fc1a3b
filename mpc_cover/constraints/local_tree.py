"""The local minimum spanning tree of 6.1.2: agents choose edges in their neighbourhoods that keep the fleet connected.

Agent i knows itself and its neighbours, computes the minimum spanning tree of that subgraph, and keeps the
tree's edges that end in i. Edges are compared by (weight, lower agent, higher agent): a total order, so that all
agents break ties alike. Then an edge of the fleet's minimum spanning tree is chosen by both its ends:
were (i, j) not in i's local tree, a path of lesser edges would join i and j there, and so in the fleet,
against the cycle property (6.1.1). So the edges both ends chose (the intersection), those one end chose (the
union), and each agent's own choice all contain the fleet's minimum spanning tree. Without a total order the
intersection may lose a tie's edge at one end and its rival at the other. Weights need not be lengths.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.pairs import all_pairs

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray, IntArray


def local_choices(weight: FloatArray, reach: float) -> BoolArray:
    """Return (m, m): whether agent i (row) keeps its edge to neighbour j (column), 6.1.2.

    Row i depends only on the weights between i and its neighbours, so that an agent may call this for its
    own neighbourhood, with agents in the order of their ids, and use its own row.

    Parameters
    ----------
    weight : (m, m) symmetric; distances [m] or another cost of the links.
    reach : edges up to this weight exist (rho_C); NaN makes no edge.
    """
    agents = weight.shape[0]
    rank = edge_ranks(weight, reach)
    none = agents * agents
    hears = rank < none
    inside = hears | np.eye(agents, dtype=bool)
    # Prim from agent i in the graph of i and its neighbours, for all i at once
    open_ = inside.copy()
    np.fill_diagonal(open_, val=False)
    near, parent = rank.copy(), np.repeat(np.arange(agents)[:, None], agents, axis=1)
    chosen = np.zeros((agents, agents), dtype=bool)
    row = np.arange(agents)
    for _ in range(int(hears.sum(axis=1).max(initial=0))):
        new = np.argmin(np.where(open_, near, none), axis=1)
        grown = open_[row, new] & (near[row, new] < none)
        chosen[row[grown], new[grown]] |= parent[row[grown], new[grown]] == row[grown]
        open_[row, new] = False
        closer = grown[:, None] & (rank[new] < near)
        near = np.where(closer, rank[new], near)
        parent = np.where(closer, new[:, None], parent)
    return chosen


def redundant_choices(weight: FloatArray, reach: float) -> BoolArray:
    """Return (m, m): edges that agent i (row) keeps so that the loss of any one agent leaves the others connected.

    They are its choices in its neighbourhood, and in its neighbourhood without each one of its neighbours. So the edges
    kept contain the minimum spanning tree of the fleet and, by the same argument, that of the fleet without any one
    agent: the graph tolerates the loss of every agent that is no cut vertex. Arguments as those of `local_choices`.
    """
    chosen = local_choices(weight, reach)
    for lost in range(weight.shape[0]):
        without = weight.copy()
        without[lost] = without[:, lost] = np.nan
        chosen |= local_choices(without, reach)
    return chosen


def edge_ranks(weight: FloatArray, reach: float) -> IntArray:
    """Return (m, m): the rank of each edge in the total order (weight, lower agent, higher agent).

    m^2 where there is no edge: above `reach`, NaN, and on the diagonal.
    """
    agents = weight.shape[0]
    first, second = all_pairs(agents)
    value = weight[first, second]
    exists = value <= reach  # False for NaN
    order = np.argsort(np.where(exists, value, np.inf), kind="stable")  # pairs come in the order of their ids
    place = np.full(first.size, agents * agents)
    place[order] = np.arange(first.size)
    place[~exists] = agents * agents
    rank = np.full((agents, agents), agents * agents)
    rank[first, second] = rank[second, first] = place
    return rank


def kept_by_both(choice: BoolArray) -> BoolArray:
    """Return (m, m) symmetric: edges that both ends chose; the sparsest connected choice."""
    return choice & choice.T


def kept_by_either(choice: BoolArray) -> BoolArray:
    """Return (m, m) symmetric: edges that at least one end chose; the thesis's T* of 6.1.2."""
    return choice | choice.T


def distances(position: FloatArray) -> FloatArray:
    """Return distances (m, m) [m] of agents at (m, d) [m]: bitwise equal for (i, j) and (j, i), and in any subset."""
    offset = position[:, None] - position[None]
    square = offset[..., 0] ** 2
    for axis in range(1, position.shape[1]):
        square = square + offset[..., axis] ** 2
    return np.asarray(np.sqrt(square))
