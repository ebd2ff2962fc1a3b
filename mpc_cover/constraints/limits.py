"""Speed and input bounds (4.13, 4.14) as polytopes inscribed in their discs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.facets import Facets, turned_normals
from mpc_cover.constraints.rows import Layout, Rows

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray


def speed_rows(layout: Layout, velocity: FloatArray, speed_max: FloatArray, facets: Facets) -> Rows:
    """Return ||v_i(n)|| <= v_max for n = 1..N, as an inner polytope turned towards the iterate.

    `velocity` is the iterate (N+1, m, d) [m/s]; `speed_max` (m,) [m/s].
    """
    normal = turned_normals(facets, velocity[1:])
    bound = np.broadcast_to((facets.shrink * speed_max)[None, :, None], normal.shape[:3]).ravel()
    row, column = _difference_columns(layout, normal.shape[2])
    return Rows(row, column, normal.ravel(), -bound, bound)


def input_rows(layout: Layout, velocity: FloatArray, input_max: FloatArray, period: float, facets: Facets) -> Rows:
    """Return ||v_i(n+1) - v_i(n)|| <= T_s u_max for n = 0..N-1, as an inner polytope turned towards the iterate.

    `velocity` is the iterate (N+1, m, d) [m/s], sample 0 given; `input_max` (m,) [m/s^2].
    """
    normal = turned_normals(facets, np.diff(velocity, axis=0))
    bound = np.broadcast_to((period * facets.shrink * input_max)[None, :, None], normal.shape[:3])
    given = np.zeros(normal.shape[:3])
    given[0] = np.einsum("ifd,id->if", normal[0], velocity[0])
    row, column = _difference_columns(layout, normal.shape[2])
    later = row >= layout.agents * normal.shape[2]  # v(0) is given, no column stands for it
    shift = layout.agents * layout.dimension
    value = normal.ravel()
    return Rows(
        row=np.concatenate([row, row[later]]),
        column=np.concatenate([column, column[later] - shift]),
        value=np.concatenate([value, -value[later]]),
        lower=(given - bound).ravel(),
        upper=(given + bound).ravel(),
    )


def _difference_columns(layout: Layout, facet_count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return triplet rows and columns of one facet row an (n, i, f), over the d coordinates of v_i(n+1)."""
    first = layout.half + layout.dimension * np.arange(layout.steps * layout.agents)
    column = np.repeat(first, facet_count)[:, None] + np.arange(layout.dimension)
    row = np.repeat(np.arange(column.shape[0]), layout.dimension)
    return row, column.ravel()
