"""Speed and input bounds (4.13, 4.14) as polytopes inscribed in their discs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.facets import Facets, turned_normals
from mpc_cover.constraints.rows import Layout, Rows

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray


def speed_rows(layout: Layout, velocity: FloatArray, speed_max: FloatArray, facets: Facets, first: int = 1) -> Rows:
    """Return ||v_i(n)|| <= v_max for n = first..N, as inscribed polytopes with a vertex at the iterate.

    `velocity` is the iterate (N+1, m, d) [m/s]; `speed_max` (m,) [m/s]. A given velocity at sample 0 is not
    constrained: `first` is 0 only when the start is free.
    """
    normal = turned_normals(facets, velocity[first:])
    bound = np.broadcast_to((facets.shrink * speed_max)[None, :, None], normal.shape[:3]).ravel()
    row, column = _velocity_columns(layout, normal.shape[2], first)
    return Rows(row, column, normal.ravel(), -bound, bound)


def input_rows(layout: Layout, velocity: FloatArray, input_max: FloatArray, period: float, facets: Facets) -> Rows:
    """Return ||v_i(n+1) - v_i(n)|| <= T_s u_max for n = 0..N-1, as inscribed polytopes with a vertex at the iterate.

    `velocity` is the iterate (N+1, m, d) [m/s]; `input_max` (m,) [m/s^2].
    """
    normal = turned_normals(facets, np.diff(velocity, axis=0))
    bound = np.broadcast_to((period * facets.shrink * input_max)[None, :, None], normal.shape[:3]).ravel()
    row, column = _velocity_columns(layout, normal.shape[2], 1)
    before = column - layout.agents * layout.dimension
    value = normal.ravel()
    return Rows(
        row=np.concatenate([row, row]),
        column=np.concatenate([column, before]),
        value=np.concatenate([value, -value]),
        lower=-bound,
        upper=bound,
    )


def _velocity_columns(layout: Layout, facet_count: int, first: int) -> tuple[IntArray, IntArray]:
    """Return triplet rows and columns: one row for each (n, i, facet), n >= first, over the d coordinates of v_i(n)."""
    stages = np.arange(first * layout.agents, (layout.steps + 1) * layout.agents)
    begin = layout.half + layout.dimension * stages
    column = np.repeat(begin, facet_count)[:, None] + np.arange(layout.dimension)
    row = np.repeat(np.arange(column.shape[0]), layout.dimension)
    return row, column.ravel()
