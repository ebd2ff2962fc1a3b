"""Connectivity (4.20): the edges of a minimum spanning tree stay within range, interval by interval."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.facets import Facets, turned_normals
from mpc_cover.constraints.graph import fleet_trees
from mpc_cover.constraints.pairs import PairDistances, elastic_pair_rows

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.constraints.rows import Layout, Rows
    from mpc_cover.model.fleet_constraints import FleetConstraints


def kept_edges(
    pairs: PairDistances, allowed: float, between: float, fleet: FleetConstraints, first: int
) -> tuple[BoolArray, FloatArray]:
    """Return (N+1, pairs): which edges are constrained at which samples, and the largest length of each [m].

    An edge within the margin may keep its length; one longer than `allowed` [m] must become shorter.
    """
    tree = fleet_trees(pairs.most, fleet)
    held = np.zeros(pairs.sampled.shape, dtype=bool)
    held[1:] |= tree
    held[:-1] |= tree
    held[:first] = False
    length = pairs.sampled
    return held, np.where(length > allowed, allowed, np.maximum(allowed - between, length))


def connectivity_rows(
    layout: Layout,
    pairs: PairDistances,
    allowed: float,
    between: float,
    reach: float,
    facets: Facets,
    *,
    fleet: FleetConstraints,
    first: int = 1,
) -> Rows:
    """Return ||q_i - q_j|| <= allowed for the tree's edges, as inscribed polytopes with a vertex at the iterate.

    The tree of an interval is the Euclidean minimum spanning tree under the largest distance within it, and
    its edges are kept at both ends: the graph then stays connected between samples too, while the topology
    may change from one interval to the next.

    Parameters
    ----------
    allowed : rho_C less a margin [m].
    between : how much a path may deviate from its chord [m], subtracted where the iterate leaves that much room.
    reach : how much a distance can change within the trust region [m]; facets farther away need no row.
    fleet : its active agents, and the links that are kept at all times (fixed topology, 4.19).
    first : the first sample that is not given.
    """
    held, radius = kept_edges(pairs, allowed, between, fleet, first)
    sample, pair = np.nonzero(held)
    difference = pairs.difference[sample, pair]
    bound = radius[sample, pair] * facets.shrink
    normal = turned_normals(facets, difference)
    both = np.concatenate([normal, -normal], axis=1)
    along = np.einsum("efd,ed->ef", both, difference)
    edge, facet = np.nonzero(along + reach > bound[:, None])
    _, slack = np.unique(edge, return_inverse=True)
    return elastic_pair_rows(
        layout, sample[edge], pair[edge], both[edge, facet], bound[edge], np.asarray(slack, dtype=np.intp)
    )
