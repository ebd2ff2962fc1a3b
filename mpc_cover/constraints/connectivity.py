"""Connectivity (4.20): the edges of a minimum spanning tree stay within range, interval by interval."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.facets import Facets, turned_normals
from mpc_cover.constraints.graph import fleet_trees
from mpc_cover.constraints.pairs import PairDistances, elastic_pair_rows

if TYPE_CHECKING:
    from mpc_cover.constraints.rows import Layout, Rows
    from mpc_cover.mission.fleet import Fleet


def connectivity_rows(
    layout: Layout,
    pairs: PairDistances,
    allowed: float,
    between: float,
    reach: float,
    facets: Facets,
    *,
    fleet: Fleet,
    first: int = 1,
) -> Rows:
    """Return ||q_i - q_j|| <= allowed for the tree's edges as inner polytopes turned towards the iterate.

    The tree of an interval is the Euclidean minimum spanning tree under the largest distance within it, and
    its edges are kept at both ends: the graph then stays connected between samples too, while the topology
    may change from one interval to the next.

    Parameters
    ----------
    allowed : rho_C less a margin [m].
    between : what a path may leave its chord by, taken off where the iterate has that much room [m].
    reach : how much a distance may change within the trust region [m]; facets farther away need no row.
    fleet : who takes part, and which further pairs are kept always (fixed topology, 4.19).
    first : the first sample that is not given.
    """
    tree = fleet_trees(pairs.most, fleet)
    held = np.zeros((layout.steps + 1, tree.shape[1]), dtype=bool)
    held[1:] |= tree
    held[:-1] |= tree
    held[:first] = False
    sample, pair = np.nonzero(held)
    difference = pairs.difference[sample, pair]
    length = pairs.sampled[sample, pair]
    # an edge inside the margin may stay where it is, one that is too long must come back
    bound = np.where(length > allowed, allowed, np.maximum(allowed - between, length)) * facets.shrink
    normal = turned_normals(facets, difference)
    both = np.concatenate([normal, -normal], axis=1)
    along = np.einsum("efd,ed->ef", both, difference)
    edge, facet = np.nonzero(along + reach > bound[:, None])
    needed, slack = np.unique(edge, return_inverse=True)
    del needed
    return elastic_pair_rows(
        layout, sample[edge], pair[edge], both[edge, facet], bound[edge], np.asarray(slack, dtype=np.intp)
    )
