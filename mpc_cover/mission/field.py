"""The set of interest W as cells (thesis 3.2.2, 4.3.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.mission.config import BoxShape, DiscShape, PolygonShape

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.mission.config import Area, Shape


@dataclass(frozen=True, eq=False)
class Field:
    """The cells of W.

    Attributes
    ----------
    cell : (K, d) centroids [m], row-major from the lower corner.
    cell_size : edge of a cell [m].
    shape_min, shape_max : (d,) bounding box of W [m].
    weight : (K,) how much each cell matters, > 0; 1 by default. Cells of weight 0 are no cells.
    """

    cell: FloatArray
    cell_size: float
    shape_min: FloatArray
    shape_max: FloatArray
    weight: FloatArray

    @property
    def size(self) -> int:
        """Number of cells K."""
        return int(self.cell.shape[0])

    @property
    def measure(self) -> float:
        """Area [m^2] (volume [m^3]) of the cells together."""
        return float(self.size * self.cell_size ** self.cell.shape[1])


def bounding_box(shape: Shape) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper corner (d,) [m] of a shape."""
    match shape:
        case BoxShape():
            return np.array(shape.min_m), np.array(shape.max_m)
        case DiscShape():
            center = np.array(shape.center_m)
            return center - shape.radius_m, center + shape.radius_m
        case PolygonShape():
            outline = np.array(shape.outline_m)
            return outline.min(axis=0), outline.max(axis=0)


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

            polygon = shapely.Polygon(shape.outline_m, shape.holes_m)
            return np.asarray(shapely.covers(polygon, shapely.points(point)), dtype=bool)


def build_field(area: Area) -> Field:
    """Cut W into the square cells whose centroids lie in it.

    The last row and column are kept when the size does not divide the box: their centroids are
    pulled in to the box's edge, so that no strip of W goes unmeasured.
    """
    lower, upper = bounding_box(area.shape)
    size = area.cell_size_m
    rounding = 1e-9 + 4.0 * float(np.spacing(np.abs([lower, upper]).max())) / size  # coordinates may be far from 0
    axes = []
    for low, high in zip(lower, upper, strict=True):
        count = max(1, int(np.ceil((high - low) / size - rounding)))
        axes.append(np.minimum(low + (np.arange(count) + 0.5) * size, high))
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    cell = grid[contains(area.shape, grid)]
    weight = cell_weights(area, cell, lower, upper)
    return Field(cell[weight > 0.0], size, lower, upper, weight[weight > 0.0])


def cell_weights(area: Area, cell: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Return (K,): the weight map's value at each centroid, the map stretched over the box from `lower` to `upper`."""
    if area.weights is None or not area.weights.values:
        return np.ones(cell.shape[0])
    table = np.array(area.weights.values)
    place = (cell[:, :2] - lower[:2]) / (upper[:2] - lower[:2])
    index = np.clip((place * table.shape).astype(int), 0, np.array(table.shape) - 1)
    return np.asarray(table[index[:, 0], index[:, 1]])
