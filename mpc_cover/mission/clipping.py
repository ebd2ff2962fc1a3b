"""The part of each cell that lies in W, and a point of it: border cells count for what they are."""

from __future__ import annotations

import re
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.mission.config import BoxShape, DiscShape, PolygonShape

if TYPE_CHECKING:
    import shapely

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.config import Shape

_WHOLE = 1e-6
"""Cells that lack less than this lie in W as a whole: the rounding of coordinates that may be far from 0."""
_REPAIRED = 1e-3
"""Part of the area that a repair of a polygon may change. A plain choice."""
_NO_AREA = 1e-12
"""Areas below this part of the square of the extent are rounding."""
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


@lru_cache(maxsize=8)
def polygon_of(shape: PolygonShape) -> shapely.Polygon | shapely.MultiPolygon:
    """Return the polygon; one that is not simple is repaired where that hardly changes its area.

    Spikes and holes that touch the outline are no mistakes; a crossing that makes it doubtful what lies inside is.

    Raises
    ------
    ValueError
        It has no area, or what lies inside is in doubt: with the reason and the point.
    """
    import shapely  # noqa: PLC0415 - as above

    polygon = shapely.Polygon(shape.outline_m, shape.holes_m)
    meant = shapely.Polygon(shape.outline_m).area - sum(shapely.Polygon(hole).area for hole in shape.holes_m)
    width, height = np.ptp(np.array(shape.outline_m), axis=0)
    if polygon.is_valid and meant > 0.0:
        return polygon
    reason = re.sub(r"\[(\S+) (\S+)\]", r" at (\1, \2)", shapely.is_valid_reason(polygon))
    outline, *holes = (shapely.make_valid(shapely.Polygon(ring)) for ring in (shape.outline_m, *shape.holes_m))
    parts = shapely.get_parts(shapely.difference(outline, shapely.union_all(holes)))
    solid = shapely.union_all([part for part in parts if part.geom_type in {"Polygon", "MultiPolygon"}])
    if max(solid.area, meant) <= _NO_AREA * float(width**2 + height**2):
        raise ValueError("must have an area: its corners lie on a line or in a point")
    if abs(solid.area - meant) > _REPAIRED * meant:
        raise ValueError(f"must be simple with its holes inside: {reason}")
    return solid
