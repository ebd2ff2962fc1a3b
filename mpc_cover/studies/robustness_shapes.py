"""The missions that the robustness study varies: small areas of every kind of shape, and crowded fleets."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.studies.mission_transforms import Raw

    Points = Sequence[tuple[float, float]]

_CELL_M = 0.5
_DEFAULTS = {"sensing_radius_m": 1.0, "speed_max_m_per_s": 1.5, "input_max_m_per_s2": 1.5}
_CONTROL = {"period_s": 0.5, "horizon_steps": 20, "planning_time_s": 3.0}
"""Planning before the start takes half of the default time, as the missions are small."""
_SPACING_M, _SEPARATION_M = 1.05, 1.0
"""Of crowds: they start hardly farther apart than they must be."""
_REACHES = (1.1, 1.2, 1.5, 3.0)
"""Communication ranges of crowds [m]."""


def shapes() -> dict[str, Raw]:
    """Return the missions over connected areas by the name of their shape."""
    corner: Points = [(1.0, 1.0), (3.0, 1.0), (1.0, 3.0)]
    box = shapely.box
    given: dict[str, tuple[shapely.Polygon, Points, float | None]] = {
        "box": (box(0, 0, 8, 8), [(1.0, 1.0), (3.0, 1.0), (2.0, 3.0)], 5.5),
        "L": (_union(box(0, 0, 9, 3.5), box(0, 0, 3.5, 9)), corner, 7.0),
        "hole": (box(0, 0, 9, 9) - box(3, 3, 6.5, 6), corner, 8.0),
        "ring": (_disc(5.0) - _disc(3.0), [(-4.0, -0.6), (-4.0, 0.6)], None),
        "power line": (_line([(0, 0), (8, 2), (14, 0), (22, 5), (28, 3)], 0.6), [(0.5, 0.1), (1.5, 0.4)], None),
        "dumbbell": (_union(box(0, 0, 4, 4), box(4, 1.6, 11, 2.4), box(11, 0, 15, 4)), corner[::2], None),
        "triangle": (shapely.Polygon([(0, 0), (18, 1.0), (18, 3.4)]), [(2.0, 0.2), (4.0, 0.5)], None),
        "diagonal": (_line([(0, 0), (15, 15)], 1.6), [(0.5, 0.5), (1.5, 1.5)], None),
    }
    return {name: _mission(name, _polygon(area), starts, reach) for name, (area, starts, reach) in given.items()}


def islands() -> dict[str, Raw]:
    """Return the missions over areas in several parts, which a weight map leaves of a box."""
    box = shapely.box
    given: dict[str, tuple[list[shapely.Polygon], Points]] = {
        "lanes": ([box(0, y, 14, y + 1) for y in (0, 5, 10)], [(0.5, 0.5), (2.0, 0.5)]),
        "islands": ([box(0, 0, 4, 3), box(7, 1, 10, 4), box(1, 6, 4, 9), box(8, 8, 10, 10)], [(1.0, 1.0), (3.0, 1.0)]),
        "far islands": ([box(0, 0, 4, 4), box(34, 0, 38, 4)], [(1.0, 1.0), (3.0, 1.0), (1.0, 3.0)]),
    }
    found = {}
    for name, (parts, starts) in given.items():
        shape, weights = _weighted(shapely.MultiPolygon(parts))
        mission = _mission(name, shape, starts, None)
        mission["area"]["weights"] = {"values": weights}
        found[name] = mission
    return found


def crowds() -> dict[str, dict[str, Raw]]:
    """Return missions of crowded fleets by formation, then by communication range."""
    area = {"kind": "box", "min_m": [0.0, 0.0], "max_m": [12.0, 9.0]}
    blocks = {f"block of {size}": (size, columns) for size, columns in ((4, 2), (6, 3), (9, 3))}
    formations = {f"line of {size}": (size, size) for size in (2, 3, 4, 6)} | blocks
    found: dict[str, dict[str, Raw]] = {}
    for name, (size, columns) in formations.items():
        places = [(1.0 + _SPACING_M * (i % columns), 1.0 + _SPACING_M * (i // columns)) for i in range(size)]
        found[name] = {
            f"range {reach:g} m": _mission(f"{name} {reach:g}", area, places, reach, _SEPARATION_M)
            for reach in _REACHES
        }
    return found


def _mission(name: str, shape: Raw, starts: Points, reach: float | None, separation: float = 0.5) -> Raw:
    fleet: dict[str, Any] = {
        "defaults": dict(_DEFAULTS),
        "agents": [{"id": f"a{i + 1}", "start_m": list(start)} for i, start in enumerate(starts)],
        "separation_min_m": separation,
    }
    if reach is not None:
        fleet["communication_range_m"] = reach
    area = {"shape": shape, "cell_size_m": _CELL_M}
    return {"schema": 1, "name": name.replace(" ", "-"), "area": area, "fleet": fleet, "control": dict(_CONTROL)}


def _polygon(area: shapely.Polygon) -> Raw:
    outline, *holes = ([[float(x), float(y)] for x, y in ring.coords[:-1]] for ring in (area.exterior, *area.interiors))
    return {"kind": "polygon", "outline_m": outline, "holes_m": holes}


def _weighted(area: shapely.Geometry) -> tuple[Raw, list[list[float]]]:
    """Return the bounding box of an area, and a weight map of 1 for the cells in it and 0 for the others."""
    lower, upper = np.array(area.bounds).reshape(2, 2)
    counts = np.round((upper - lower) / _CELL_M).astype(int)
    axes = [low + _CELL_M * (np.arange(count) + 0.5) for low, count in zip(lower, counts, strict=True)]
    x, y = np.meshgrid(*axes, indexing="ij")
    inside = shapely.contains_xy(area, x, y)
    return {"kind": "box", "min_m": lower.tolist(), "max_m": upper.tolist()}, inside.astype(float).tolist()


def _union(*parts: shapely.Polygon) -> shapely.Polygon:
    return shapely.union_all(parts)


def _disc(radius: float) -> shapely.Polygon:
    return shapely.Point(0, 0).buffer(radius, quad_segs=12)


def _line(corners: Points, width: float) -> shapely.Polygon:
    return shapely.LineString(corners).buffer(0.5 * width, cap_style="flat", join_style="mitre")
