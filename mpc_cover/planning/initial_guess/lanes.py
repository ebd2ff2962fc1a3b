"""Lanes one sensing swath wide, and coverage paths along them: in strips, as one cut path, or abreast as a comb."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise, permutations
from typing import TYPE_CHECKING

import numpy as np
import scipy

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import FloatArray

_INSET = 0.75
"""Distance by which lanes end before the last cell, in sensing radii; a plain choice."""
_LONG_LANE, _CORNER_SHARE = 24.0, 0.8
"""Length of lanes, in sensing radii, that end so near that the corners are measured, and the part of the distance that
is left of the radius there; plain choices."""
_SLOW_HALF_WIDTH, _SLOW_INSET = 0.72, 0.5
"""Half the width of lanes and their inset, in sensing radii, where agents pass slowly for many looks: lanes overlap and
reach into corners, so that cells between lanes get nearly as many looks as those on them. Wider and narrower lanes took
longer, as observed."""
_HALF_STEP_MAX = 0.7
"""Bound on half the distance between samples, in sensing radii, that narrows the swath; a plain choice."""
_ROW_DECIMALS, _ROW_ROUNDING, _BAND_ROUNDING = 9, 1e-9, 1e-8
"""Decimals to which coordinates of cells are rounded to find rows [m], and tolerances of comparisons with rows and with
the first rows of bands [m]. Plain choices far below any cell's size."""
_CUT_ROUNDING = 1e-6
"""Waypoints nearer than this to a cut of a path are left out [m]; a plain choice."""
_ALL_PERMUTATIONS = 6
"""Agents up to which all assignments are compared, at most 720; a plain choice. Beyond, a linear assignment is used."""
_TIME_DECIMALS = 6
"""Decimals to which the largest times of assignments are compared [s], so that rounding breaks no tie; plain choice."""
_COST_POWER = 3
"""Power of the times whose sum the linear assignment minimises: it approximates the smallest maximum. Plain choice."""


@dataclass(frozen=True)
class Swath:
    """The swath of a moving sensing disc.

    Attributes
    ----------
    half_width : distance to either side that is measured, between samples as well [m].
    radius : sensing radius [m].
    inset : distance by which lanes end before the last cell, in sensing radii.
    """

    half_width: float
    radius: float
    inset: float = _INSET


def swath_of(radius: float, speed: float, period: float) -> Swath:
    """Return the swath of a disc of `radius` [m] that measures every `period` [s] at `speed` [m/s].

    Halfway between two samples the discs reach sqrt(rho^2 - (v T_s / 2)^2) to the side. For sparse samples the half
    distance is bounded, and the SQP has to improve the path.
    """
    half_step = min(0.5 * speed * period, _HALF_STEP_MAX * radius)
    return Swath(float(np.sqrt(radius**2 - half_step**2)), radius)


def slow_swath(radius: float) -> Swath:
    """Return the swath of a disc that passes so slowly that each cell in it gets many looks; `radius` [m]."""
    return Swath(_SLOW_HALF_WIDTH * radius, radius, _SLOW_INSET)


@dataclass(frozen=True, eq=False)
class Lane:
    """A straight line from `low` to `high`, both (d,) [m], along one axis."""

    low: FloatArray
    high: FloatArray


def cut_lanes(cell: FloatArray, swath: Swath, axis: int, count: int = 1) -> list[Lane]:
    """Return lanes along `axis` that together sweep the (K, d) cells [m].

    Lanes are side by side along the other axis (in three dimensions along the two other axes, of which the last varies
    slowest). In the plane there are at least `count` lanes.
    """
    others = [a for a in range(cell.shape[1]) if a != axis]
    groups = [cell]
    for other in reversed(others):
        groups = [part for group in groups for part in _bands(group, swath, other, count if len(others) == 1 else 1)]
    return [_lane(group, swath, axis, others) for group in groups]


def _bands(cell: FloatArray, swath: Swath, axis: int, count: int) -> list[FloatArray]:
    """Cut cells into as few bands as the swath allows, each as wide as possible, or into `count` equal ones."""
    coordinate = cell[:, axis]
    rows = np.unique(np.round(coordinate, _ROW_DECIMALS))
    first = [rows[0]]
    while (later := rows[rows > first[-1] + 2.0 * swath.half_width + _ROW_ROUNDING]).size:
        first.append(later[0])
    if count > len(first):
        first = [part[0] for part in np.array_split(rows, min(count, len(rows)))]
    number = np.searchsorted(np.array(first), coordinate + _BAND_ROUNDING, side="right") - 1
    return [cell[number == band] for band in range(len(first)) if (number == band).any()]


def _lane(cell: FloatArray, swath: Swath, axis: int, others: Sequence[int]) -> Lane:
    low, high = np.empty(cell.shape[1]), np.empty(cell.shape[1])
    for other in others:
        low[other] = high[other] = 0.5 * (cell[:, other].min() + cell[:, other].max())
    first, last = cell[:, axis].min(), cell[:, axis].max()
    inset = min(_inset(cell, swath, others, last - first), 0.5 * (last - first))
    low[axis], high[axis] = first + inset, last - inset
    return Lane(low, high)


def _inset(cell: FloatArray, swath: Swath, others: Sequence[int], length: float) -> float:
    """Return the distance by which a lane ends before its last cells [m].

    Refinements round the ends of short lanes better than those of long ones, which have to come near their corners.
    """
    if length <= _LONG_LANE * swath.radius:
        return swath.inset * swath.radius
    aside = 0.5 * (cell[:, others].max(axis=0) - cell[:, others].min(axis=0))
    reach = max(swath.radius**2 - float((aside**2).sum()), 0.0) ** 0.5
    return float(min(swath.inset * swath.radius, _CORNER_SHARE * reach))


def snake(lanes: Sequence[Lane], start: FloatArray) -> FloatArray:
    """Return (W, d) waypoints [m] along all lanes in alternating directions, from the corner nearest `start` (d,)."""
    best: FloatArray | None = None
    for ordered in (list(lanes), list(reversed(lanes))):
        for upward in (True, False):
            path = _alternating(ordered, upward=upward)
            if best is None or np.linalg.norm(path[0] - start) < np.linalg.norm(best[0] - start):
                best = path
    assert best is not None
    return best


def _alternating(lanes: Sequence[Lane], *, upward: bool) -> FloatArray:
    points = []
    for number, lane in enumerate(lanes):
        ends = [lane.low, lane.high] if upward == (number % 2 == 0) else [lane.high, lane.low]
        points += ends
    return np.array(points)


def cut_snake(lanes: Sequence[Lane], share: FloatArray, *, mirrored: bool, upward: bool) -> list[FloatArray]:
    """Return the waypoints of pieces, in proportion to `share` (P,), of one alternating path along all lanes."""
    ordered = list(reversed(lanes)) if mirrored else list(lanes)
    path = _alternating(ordered, upward=upward)
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    cuts = np.concatenate([[0.0], np.cumsum(share) / np.sum(share)]) * at[-1]
    pieces = []
    for low, high in pairwise(cuts):
        ends = np.stack([np.interp([low, high], at, path[:, a]) for a in range(path.shape[1])], axis=1)
        inside = path[(at > low + _CUT_ROUNDING) & (at < high - _CUT_ROUNDING)]
        pieces.append(np.concatenate([ends[:1], inside, ends[1:]]))
    return pieces


def assign_pieces(
    pieces: Sequence[FloatArray], start: FloatArray, speed: FloatArray, *, one_way: bool = False
) -> list[FloatArray]:
    """Return for each of the (m, d) starts [m] the piece it flies, in the better direction, so that all end early.

    `speed` is (m,) [m/s]. With `one_way` all fly in the direction of the whole path, so that no two agents are at the
    junction of two pieces at the same time.
    """
    length = np.array([np.linalg.norm(np.diff(piece, axis=0), axis=1).sum() for piece in pieces])
    ends = np.array([[piece[0], piece[-1]] for piece in pieces])
    distance = np.linalg.norm(start[:, None, None] - ends[None], axis=3)
    if one_way:
        distance = np.repeat(distance[:, :, :1], 2, axis=2)
    match = assign_times((distance.min(axis=2) + length) / speed[:, None])
    flown = []
    for agent, piece in enumerate(match):
        backward = distance[agent, piece, 1] < distance[agent, piece, 0]
        flown.append(pieces[piece][::-1] if backward else pieces[piece])
    return flown


def strips(cell: FloatArray, share: FloatArray, axis: int) -> list[FloatArray]:
    """Cut the (K, d) cells [m] into strips across `axis`, the i-th with the part `share[i]` of them."""
    order = np.argsort(cell[:, axis], kind="stable")
    edges = np.round(np.cumsum(share) / np.sum(share) * len(order)).astype(int)
    return [cell[part] for part in np.split(order, edges[:-1])]


def comb(lanes: Sequence[Lane], start: FloatArray, *, mirrored: bool, upward: bool) -> list[FloatArray]:
    """Return each agent's waypoints for flight abreast: block after block of lanes, all agents side by side.

    `start` is (m, d) [m]. Neighbours remain a lane apart, so that the fleet stays connected whatever the size of the
    field. Agents without a lane of their own in the last block fly along with the others.
    """
    agents = start.shape[0]
    ordered = list(reversed(lanes)) if mirrored else list(lanes)
    slots: list[list[FloatArray]] = [[] for _ in range(agents)]
    for block in range(0, len(ordered), agents):
        some = ordered[block : block + agents]
        forward = upward == ((block // agents) % 2 == 0)
        for slot in range(agents):
            lane = some[min(slot, len(some) - 1)]
            if slot < len(some):
                slots[slot] += [lane.low, lane.high] if forward else [lane.high, lane.low]
    firsts = np.array([slot[0] if slot else start.mean(axis=0) for slot in slots])
    match = assign(start, firsts)
    return [np.array(slots[match[i]]) if slots[match[i]] else start[i][None] for i in range(agents)]


def assign(start: FloatArray, goal: FloatArray) -> list[int]:
    """Return for each of the (m, d) starts [m] the index of its goal, so that the longest distance is small."""
    return assign_times(np.linalg.norm(start[:, None] - goal[None], axis=2))


def assign_times(times: FloatArray) -> list[int]:
    """Return for each row of a square table [s] the column assigned to it: a small largest entry, then a small sum."""
    if len(times) <= _ALL_PERMUTATIONS:
        order = list(permutations(range(len(times))))
        table = times[np.arange(len(times)), np.array(order)]
        best = int(np.lexsort((table.sum(axis=1), np.round(table.max(axis=1), _TIME_DECIMALS)))[0])
        return list(order[best])
    _, column = scipy.optimize.linear_sum_assignment(times**_COST_POWER)
    return [int(c) for c in column]
