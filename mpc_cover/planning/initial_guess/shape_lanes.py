"""Lanes that follow a shape: cells are swept row by row, and a lane is as long as the shape is where it lies.

This is the boustrophedon cellular decomposition (Choset, Autonomous Robots 9, 2000) at the width of a swath: a lane
ends where the shape does, and a wider or narrower part of it has lanes of its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

from mpc_cover.coverage.nearest_points import DENSE, pairwise_distance

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray, IntArray

_ROWS_MIN = 2.0
"""Rows of cells into which half a swath is divided at least, where cells are few; a plain choice."""
_ROUNDING = 1e-6
"""Tolerance of comparisons of coordinates, in half widths of a swath; a plain choice far below any cell."""


def shape_lanes(cell: FloatArray, half_width: float, axes: FloatArray) -> FloatArray:
    """Return lanes (L, 2, d) [m] that pass every one of the (K, d) cells [m] within `half_width` [m].

    `axes` (d, d) has orthonormal rows: lanes are along the first, rows are stacked along the others. Each lane begins
    with the lowest row of cells that no lane has, and takes what lies next to that row, a swath wide.
    """
    turned = cell @ axes.T
    across = half_width / np.sqrt(max(cell.shape[1] - 1, 1))
    layers = [np.arange(len(cell))]
    for other in range(cell.shape[1] - 1, 1, -1):  # in space: slabs a swath high
        layers = [slab for layer in layers for slab in _slabs(turned, layer, other, across)]
    lanes = [lane for layer in layers for lane in _lanes_of_layer(turned[layer], across, half_width)]
    return np.array(lanes) @ axes


def _slabs(turned: FloatArray, layer: IntArray, axis: int, across: float) -> list[IntArray]:
    """Cut a layer, indices of cells, into slabs two `across` [m] high, from the lowest cell on."""
    value = turned[layer, axis]
    slabs = []
    while value.size:
        inside = value <= value.min() + 2.0 * across * (1.0 + _ROUNDING)
        slabs.append(layer[inside])
        layer, value = layer[~inside], value[~inside]
    return slabs


def _lanes_of_layer(turned: FloatArray, across: float, half_width: float) -> list[FloatArray]:
    """Return lanes (2, d) [m] of cells (K, d) [m], along axis 0; axis 1 is swept."""
    row = np.rint((turned[:, 1] - turned[:, 1].min()) / _pitch(turned[:, :2], half_width)).astype(int)
    left = np.ones(len(turned), dtype=bool)
    order = np.lexsort((turned[:, 0], row))
    lanes = []
    for first in order:
        if not left[first]:
            continue
        taken = _band(turned, row, left, first, across)
        left &= ~taken
        lanes.append(_lane(turned[taken], half_width))
    return lanes


def _pitch(turned: FloatArray, half_width: float) -> float:
    """Return the distance between rows [m]: that of neighbouring cells, but no more than part of a swath."""
    if len(turned) == 1:
        return half_width / _ROWS_MIN
    if len(turned) ** 2 <= DENSE:
        distance = np.partition(pairwise_distance(turned, turned), 1, axis=1)[:, 1]
    else:
        distance = np.asarray(scipy.spatial.cKDTree(turned).query(turned, k=2)[0])[:, 1]
    positive = distance[distance > _ROUNDING * half_width]
    return min(float(np.median(positive)) if positive.size else half_width, half_width / _ROWS_MIN)


def _band(turned: FloatArray, row: IntArray, left: BoolArray, first: np.intp, across: float) -> BoolArray:
    """Return (K,): the cells of a lane that begins with the row of cell `first`.

    Each row adds the cells connected to the row below it, but no farther than half a swath beyond the ends of the first
    row: what sticks out further is the beginning of a wider part of the shape.
    """
    taken = np.zeros(len(turned), dtype=bool)
    lowest = turned[left & (row == row[first]), 1].min()
    near = np.flatnonzero(left & (turned[:, 1] <= lowest + 2.0 * across * (1.0 + _ROUNDING)) & (row >= row[first]))
    rows, order = row[near], np.lexsort((turned[near, 0], row[near]))
    low = high = turned[first, 0]
    bounds: tuple[float, float] | None = None
    near, rows = near[order], rows[order]
    for some in np.split(near, np.flatnonzero(np.diff(rows)) + 1):  # row by row, along the lane
        along = turned[some, 0]
        run = np.concatenate([[0], np.cumsum(np.diff(along) > across)])
        overlapping = np.unique(run[(along >= low - across) & (along <= high + across)])
        inside = np.isin(run, overlapping)
        if bounds is not None:
            inside &= (along >= bounds[0] - across) & (along <= bounds[1] + across)
        if not inside.any():
            break
        taken[some[inside]] = True
        low, high = along[inside].min(), along[inside].max()
        bounds = bounds or (low, high)
    return taken


def _lane(cells: FloatArray, half_width: float) -> FloatArray:
    """Return the ends (2, d) [m] of the shortest lane along axis 0 that passes (n, d) cells [m] midway."""
    low, high = cells.min(axis=0), cells.max(axis=0)
    middle = 0.5 * (low + high)
    aside = np.linalg.norm(cells[:, 1:] - middle[1:], axis=1)
    reach = np.sqrt(np.maximum(half_width**2 - aside**2, 0.0))
    begin, end = float((cells[:, 0] + reach).min()), float((cells[:, 0] - reach).max())
    if begin > end:
        begin = end = 0.5 * (begin + end)
    ends = np.repeat(middle[None], 2, axis=0)
    ends[:, 0] = begin, end
    return ends
