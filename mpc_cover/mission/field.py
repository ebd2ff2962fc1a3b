"""The set of interest W as cells (thesis 3.2.2, 4.3.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.mission.clipping import clipped, polygon_of
from mpc_cover.mission.config import BoxShape, DiscShape, PolygonShape

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.mission.config import Area, Shape

_TILED = 1e-9
"""Parts of a cell below this are rounding."""
_SLIVER = 1e-3
"""Cells of which less lies in W, and not their centroids, may be left out. A plain choice."""
_LEAST_PART = 1e-6
"""No less than this of any cell is kept: its point would be on the cell's edge, to rounding."""
_LEAST_WEIGHT = 0.25
"""Smallest weight of a border cell relative to a whole one: smaller ones would be lost in a QP's tolerance."""
_NEGLIGIBLE = 1e-3
"""... if all of them are no more of W than this. A plain choice."""


@dataclass(frozen=True, eq=False)
class Field:
    """The cells of W.

    Attributes
    ----------
    cell : (K, d) the point of W that stands for each cell, its centroid where that lies in W [m]; row-major from the
        lower corner.
    cell_size : edge of a cell [m].
    shape_min, shape_max : (d,) bounding box of W [m].
    weight : (K,) how much each cell matters, > 0: 1 by default, times `part` (at least a quarter).
        Cells of weight 0 are no cells.
    part : (K,) part of each cell that lies in W, 0 to 1.
    """

    cell: FloatArray
    cell_size: float
    shape_min: FloatArray
    shape_max: FloatArray
    weight: FloatArray
    part: FloatArray

    @property
    def size(self) -> int:
        """Number of cells K."""
        return int(self.cell.shape[0])

    @property
    def measure(self) -> float:
        """Area [m^2] (volume [m^3]) of the parts of W that matter."""
        return float(self.part.sum() * self.cell_size ** self.cell.shape[1])


def bounding_box(shape: Shape) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper corner (d,) [m] of a shape."""
    match shape:
        case BoxShape():
            return np.array(shape.min_m), np.array(shape.max_m)
        case DiscShape():
            center = np.array(shape.center_m)
            return center - shape.radius_m, center + shape.radius_m
        case PolygonShape():
            edges = np.array(polygon_of(shape).bounds)
            return edges[:2], edges[2:]


def contains(shape: Shape, point: FloatArray) -> BoolArray:
    """Return for each of the (K, d) points [m] whether it lies in the shape."""
    match shape:
        case BoxShape():
            inside = (point >= np.array(shape.min_m)) & (point <= np.array(shape.max_m))
            return np.asarray(inside.all(axis=1))
        case DiscShape():
            distance = np.linalg.norm(point - np.array(shape.center_m), axis=1)
            return np.asarray(distance <= shape.radius_m)
        case PolygonShape():
            import shapely  # noqa: PLC0415 - agents start faster without it

            return np.asarray(shapely.covers(polygon_of(shape), shapely.points(point)), dtype=bool)


def grid_axes(lower: FloatArray, upper: FloatArray, size: float) -> list[FloatArray]:
    """Return the coordinates [m] of the points that stand for a box's cells along each axis.

    They are the cells' middles; where the size does not divide the box, the last is the middle of what lies inside.
    """
    rounding = _TILED + 4.0 * float(np.spacing(np.abs([lower, upper]).max())) / size  # coordinates may be far from 0
    axes = []
    for low, high in zip(lower, upper, strict=True):
        count = max(1, int(np.ceil((high - low) / size - rounding)))
        axis = low + (np.arange(count) + 0.5) * size
        if low + count * size > high + rounding * size:
            axis[-1] = 0.5 * (low + (count - 1) * size + high)
        axes.append(axis)
    return axes


def build_field(area: Area) -> Field:
    """Cut W into square cells.

    The point that stands for a cell is its centroid where that lies in W, else a point of W inside the cell: no part of
    W goes unmeasured. What lies outside W counts neither in the cell's `part` nor in its weight. Slivers are left out
    where they are small and all of them together negligible.
    """
    lower, upper = bounding_box(area.shape)
    size = area.cell_size_m
    axes = grid_axes(lower, upper, size)
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    edges = [low + np.arange(axis.size) * size for low, axis in zip(lower, axes, strict=True)]
    low = np.stack(np.meshgrid(*edges, indexing="ij"), axis=-1).reshape(grid.shape)
    part, point = clipped(area.shape, low, np.minimum(low + size, upper), size)
    central = contains(area.shape, grid)
    point[central] = grid[central]
    sliver = ~central & (part < _SLIVER)
    if part[sliver].sum() <= _NEGLIGIBLE * part.sum():
        part[sliver] = 0.0
    kept = central | (part > _LEAST_PART)
    cell, part = point[kept], part[kept]
    weight = cell_weights(area, cell, lower, upper)
    matters = weight > 0.0
    return Field(cell[matters], size, lower, upper, (weight * np.maximum(part, _LEAST_WEIGHT))[matters], part[matters])


def cell_weights(area: Area, cell: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Return (K,): the weight map's value at each centroid, the map stretched over the box from `lower` to `upper`."""
    if area.weights is None or not area.weights.values:
        return np.ones(cell.shape[0])
    table = np.array(area.weights.values)
    place = (cell[:, :2] - lower[:2]) / (upper[:2] - lower[:2])
    index = np.clip((place * table.shape).astype(int), 0, np.array(table.shape) - 1)
    return np.asarray(table[index[:, 0], index[:, 1]])
