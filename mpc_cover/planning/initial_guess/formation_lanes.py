"""Lanes of a whole formation: as wide as its shape, and as long as it takes its agents to pass all cells."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import BoolArray, FloatArray

_ROUNDING = 1e-9
"""Tolerance of comparisons of lengths, relative to the sensing radius; a plain choice."""


@dataclass(frozen=True, eq=False)
class Sensor:
    """What the agents of a formation measure, all alike.

    Attributes
    ----------
    radius : sensing radius [m].
    half_width : of the swath between samples, per axis across a lane [m].
    """

    radius: float
    half_width: float


def lane_count(cell: FloatArray, width: float, axis: int, sensor: Sensor) -> int:
    """Return how many lanes of a formation `width` [m] wide across `axis` sweep the (K, d) cells [m]."""
    extent = float(np.ptp(cell[:, axis]))
    return max(int(np.ceil(extent / (width + 2.0 * sensor.half_width) - _ROUNDING)), 1)


def needed_width(cell: FloatArray, width: float, axis: int, sensor: Sensor) -> float:
    """Return the width [m] of a formation that takes as many lanes as one of `width` [m], of equal widths."""
    extent = float(np.ptp(cell[:, axis]))
    return max(extent / lane_count(cell, width, axis, sensor) - 2.0 * sensor.half_width, 0.0)


def formation_lanes(
    cell: FloatArray,
    shape: FloatArray,
    along: int,
    sensor: Sensor,
    box: tuple[FloatArray, FloatArray],
    here: FloatArray,
) -> FloatArray | None:
    """Return (W, d) centres [m] of a formation that sweeps the (K, d) cells [m] to and fro along an axis.

    None where it passes over none of them.

    `shape` (m, d) [m] is relative to the centre, which stays in the `box` (low, high), both (d,) [m]. The sweep begins
    at the corner that is nearest `here` (d,) [m].
    """
    across = [axis for axis in range(cell.shape[1]) if axis != along]
    middle = 0.5 * (shape.min(axis=0) + shape.max(axis=0))
    room = box[0] + middle, box[1] + middle
    bands = [_bands(cell, shape, axis, sensor, room) for axis in across]
    best: FloatArray | None = None
    for flips in product((False, True), repeat=len(bands) + 1):
        found = _serpentine(cell, shape - middle, along, bands, sensor, flips)
        if not found:
            return None
        points = np.clip(np.array(found) - middle, *box)
        if best is None or np.linalg.norm(points[0] - here) < np.linalg.norm(best[0] - here):
            best = points
    return best


@dataclass(frozen=True)
class _Bands:
    """Bands of equal width across an axis: where the formation's middle passes [m], low and high edges [m]."""

    axis: int
    centre: tuple[float, ...]
    edge: tuple[float, ...]

    def holds(self, coordinate: FloatArray, number: int, slack: float) -> BoolArray:
        """Return which coordinates (K,) [m] lie in band `number`."""
        return (coordinate >= self.edge[number] - slack) & (coordinate <= self.edge[number + 1] + slack)


def _bands(
    cell: FloatArray, shape: FloatArray, axis: int, sensor: Sensor, room: tuple[FloatArray, FloatArray]
) -> _Bands:
    count = lane_count(cell, float(np.ptp(shape[:, axis])), axis, sensor)
    low, high = float(cell[:, axis].min()), float(cell[:, axis].max())
    edge = np.linspace(low, high, count + 1)
    centre = np.clip(0.5 * (edge[:-1] + edge[1:]), room[0][axis], room[1][axis])
    return _Bands(axis, tuple(centre.tolist()), tuple(edge.tolist()))


def _serpentine(
    cell: FloatArray,
    shape: FloatArray,
    along: int,
    bands: Sequence[_Bands],
    sensor: Sensor,
    flips: tuple[bool, ...],
) -> list[FloatArray]:
    """Return centres (d,) [m] along all lanes in alternating directions; `flips` mirror each axis."""
    upward, points = flips[-1], []
    numbers = [range(len(each.centre)) for each in bands]
    order = [each[::-1] if flip else each for each, flip in zip(numbers, flips[:-1], strict=True)]
    for count, outer in enumerate(order[-1] if len(order) > 1 else [0]):
        for inner in order[0] if count % 2 == 0 else order[0][::-1]:
            lane = [inner, outer][: len(bands)]
            ends = _ends(cell, shape, along, bands, sensor, lane)
            if ends is None:
                continue
            for end in ends if upward else reversed(ends):
                point = np.empty(cell.shape[1])
                point[along] = end
                for each, number in zip(bands, lane, strict=True):
                    point[each.axis] = each.centre[number]
                points.append(point)
            upward = not upward
    return points


def _ends(
    cell: FloatArray, shape: FloatArray, along: int, bands: Sequence[_Bands], sensor: Sensor, lane: Sequence[int]
) -> tuple[float, float] | None:
    """Return where along a lane the formation's centre begins and ends [m], or None where there is no cell in it.

    Before the first and after the last cell of each row, some agent that passes over the row is there.
    """
    axes = [each.axis for each in bands]
    slack = _ROUNDING * sensor.radius
    pairs = list(zip(bands, lane, strict=True))
    inside = np.all([each.holds(cell[:, each.axis], number, slack) for each, number in pairs], axis=0)
    centre = [each.centre[number] for each, number in pairs]
    if not inside.any():
        return None
    own = cell[inside]
    aside = np.linalg.norm(own[:, None][:, :, axes] - np.array(centre) - shape[None][:, :, axes], axis=2)  # (K', m)
    reach = np.sqrt(np.maximum(sensor.radius**2 - aside**2, 0.0))
    able = aside <= sensor.radius + slack
    any_able = able.any(axis=1)
    if not any_able.any():
        return None
    # agent i measures a cell from displacements p - shape_i - reach to p - shape_i + reach
    first = np.where(able, own[:, [along]] - shape[None, :, along] + reach, -np.inf).max(axis=1)[any_able]
    last = np.where(able, own[:, [along]] - shape[None, :, along] - reach, np.inf).min(axis=1)[any_able]
    begin, end = float(first.min()), float(last.max())
    if begin > end:
        begin = end = 0.5 * (begin + end)
    return begin, end
