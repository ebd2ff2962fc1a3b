"""Exact second-order cones for speed, input and connectivity constraints (4.13, 4.14, 4.20), in place of polytopes.

A cone is h + G x in {(t, w): ||w|| <= t}: one row for t, d rows for w. Only some QP back-ends take them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from mpc_cover.constraints.connectivity import kept_edges
from mpc_cover.constraints.pairs import all_pairs

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.constraints.pairs import PairDistances
    from mpc_cover.constraints.rows import Layout
    from mpc_cover.model.fleet_constraints import FleetConstraints


@dataclass(frozen=True, eq=False)
class Cones:
    """C cones of 1 + d rows each.

    Attributes
    ----------
    bound : (C,) the constant of t [in the unit of w].
    plus, minus : (C,) first columns of the vectors whose difference is w; `minus` is -1 where there is none.
    slack : (C,) index of the slack that is added to t, from 0; -1 where there is none.
    """

    bound: FloatArray
    plus: IntArray
    minus: IntArray
    slack: IntArray


def speed_cones(layout: Layout, speed_max: FloatArray, first: int) -> Cones:
    """Return ||v_i(n)|| <= v_max for n = first..N; `speed_max` (m,) [m/s]."""
    stages = np.arange(first * layout.agents, (layout.steps + 1) * layout.agents)
    none = np.full(stages.size, -1, dtype=np.intp)
    bound = np.tile(speed_max, layout.steps + 1 - first)
    return Cones(bound, layout.half + layout.dimension * stages, none, none)


def input_cones(layout: Layout, input_max: FloatArray, period: float) -> Cones:
    """Return ||v_i(n+1) - v_i(n)|| <= T_s u_max for n = 0..N-1; `input_max` (m,) [m/s^2]."""
    stages = np.arange(layout.agents, (layout.steps + 1) * layout.agents)
    column = layout.half + layout.dimension * stages
    none = np.full(stages.size, -1, dtype=np.intp)
    bound = np.tile(period * input_max, layout.steps)
    return Cones(bound, column, column - layout.agents * layout.dimension, none)


def edge_cones(
    layout: Layout,
    pairs: PairDistances,
    allowed: float,
    between: float,
    reach: float,
    fleet: FleetConstraints,
    first: int,
) -> Cones:
    """Return ||q_i - q_j|| <= allowed + s [m] for the tree's edges; arguments as those of `connectivity_rows`.

    Edges that cannot become too long within the trust region (`reach` [m]) need no cone.
    """
    held, bound = kept_edges(pairs, allowed, between, fleet, first)
    sample, pair = np.nonzero(held & (pairs.sampled + reach > bound))
    one, two = all_pairs(layout.agents)
    plus, minus = layout.position(sample, one[pair]), layout.position(sample, two[pair])
    return Cones(bound[sample, pair], plus, minus, np.arange(sample.size))


def stack_cones(
    blocks: list[Cones], dimension: int, columns: int, slack_columns: list[int]
) -> tuple[scipy.sparse.csc_array[np.float64], FloatArray, tuple[int, ...]]:
    """Return G, h and the sizes of all cones; `slack_columns` are the columns of each block's slack 0."""
    bound = np.concatenate([block.bound for block in blocks])
    plus = np.concatenate([block.plus for block in blocks])
    minus = np.concatenate([block.minus for block in blocks])
    slack = np.concatenate(
        [np.where(block.slack >= 0, block.slack + base, -1) for block, base in zip(blocks, slack_columns, strict=True)]
    )
    top = (1 + dimension) * np.arange(bound.size)
    row, column, value = [top[slack >= 0]], [slack[slack >= 0]], [np.ones(int((slack >= 0).sum()))]
    for axis in range(dimension):
        for first, sign in ((plus, 1.0), (minus, -1.0)):
            there = first >= 0
            row.append(top[there] + 1 + axis)
            column.append(first[there] + axis)
            value.append(np.full(int(there.sum()), sign))
    rows = (1 + dimension) * bound.size
    matrix = scipy.sparse.csc_array(
        (np.concatenate(value), (np.concatenate(row), np.concatenate(column))), shape=(rows, columns)
    )
    matrix.sum_duplicates()
    right = np.zeros(rows)
    right[top] = bound
    return matrix, right, (1 + dimension,) * bound.size
