"""The part of each cell that lies in W, and a point of it: border cells count for what they are."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.mission.config import BoxShape, DiscShape, PolygonShape

if TYPE_CHECKING:
    import shapely

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.config import Shape

_WHOLE = 1e-9
"""Cells that lack less than this lie in W as a whole: rounding."""
_POINTS = {2: 16, 3: 8}
"""Points along each side of a cell on a curved border, by dimension: parts to about a hundredth. A plain choice."""


def clipped(shape: Shape, low: FloatArray, high: FloatArray, size: float) -> tuple[FloatArray, FloatArray]:
    """Return (K,) the part of each cell that lies in the shape, and (K, d) [m] a point of that; NaN where part is 0.

    Parameters
    ----------
    low, high : (K, d) corners [m] of the cells, none beyond the shape's bounding box.
    size : edge of a whole cell [m], of which parts are parts.
    """
    match shape:
        case BoxShape():
            part, point = np.prod((high - low) / size, axis=1), 0.5 * (low + high)
        case DiscShape():
            part, point = _of_ball(shape, low, high, size)
        case PolygonShape():
            part, point = _of_polygon(shape, low, high, size)
    part[part > 1.0 - _WHOLE] = 1.0
    return part, point


def _of_ball(shape: DiscShape, low: FloatArray, high: FloatArray, size: float) -> tuple[FloatArray, FloatArray]:
    """Return as `clipped`: by points inside the border cells. A ball is convex: their mean lies in it."""
    center, dimension = np.array(shape.center_m), low.shape[1]
    whole = np.prod((high - low) / size, axis=1)
    far = np.linalg.norm(np.maximum(np.abs(low - center), np.abs(high - center)), axis=1)
    near = np.linalg.norm(np.clip(center, low, high) - center, axis=1)
    border = np.flatnonzero((far > shape.radius_m) & (near < shape.radius_m))
    part, point = np.where(far <= shape.radius_m, whole, 0.0), 0.5 * (low + high)
    count, total = np.zeros(border.size), np.zeros((border.size, dimension))
    along = (np.arange(_POINTS[dimension]) + 0.5) / _POINTS[dimension]
    for place in product(along, repeat=dimension):
        sample = low[border] + np.array(place) * (high - low)[border]
        inside = np.linalg.norm(sample - center, axis=1) <= shape.radius_m
        count += inside
        total[inside] += sample[inside]
    part[border] = whole[border] * count / along.size**dimension
    point[border] = np.divide(total, count[:, None], out=np.full_like(total, np.nan), where=count[:, None] > 0.0)
    return part, point


def _of_polygon(shape: PolygonShape, low: FloatArray, high: FloatArray, size: float) -> tuple[FloatArray, FloatArray]:
    """Return as `clipped`, exactly."""
    import shapely  # noqa: PLC0415 - agents start faster without it

    polygon = polygon_of(shape)
    shapely.prepare(polygon)
    box = shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1])
    part, point = np.where(shapely.covers(polygon, box), np.prod((high - low) / size, axis=1), 0.0), 0.5 * (low + high)
    border = np.flatnonzero((part == 0.0) & shapely.intersects(polygon, box))
    inside = shapely.intersection(polygon, box[border])
    part[border] = shapely.area(inside) / size**2
    some = part[border] > 0.0
    point[border[some]] = shapely.get_coordinates(shapely.point_on_surface(inside[some]))
    return part, point


def polygon_of(shape: PolygonShape) -> shapely.Polygon:
    """Return the polygon."""
    import shapely  # noqa: PLC0415 - as above

    return shapely.Polygon(shape.outline_m, shape.holes_m)
