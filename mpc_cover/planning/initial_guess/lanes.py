"""Paths that sweep what is owed: lanes a sensing disc wide, in strips of equal work or abreast like a comb."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise, permutations
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import FloatArray

_INSET = 0.75
"""Lanes end this part of the radius before the last cell."""
_SLOW_HALF, _SLOW_INSET = 0.72, 0.5
"""The same, and half the width of lanes, where discs pass slowly: corners are in reach, and lanes overlap.

Cells in between then get nearly as many looks as those on the lane itself; wider and narrower lanes took longer.
"""


@dataclass(frozen=True)
class Swath:
    """What a disc sweeps.

    Attributes
    ----------
    half_width : [m], so far to either side is measured, between samples too.
    radius : [m].
    inset : part of the radius by which lanes end before the last cell.
    """

    half_width: float
    radius: float
    inset: float = _INSET


def swath_of(radius: float, speed: float, period: float) -> Swath:
    """Return the swath of a disc that is looked through every `period` [s] at `speed` [m/s].

    Halfway between two samples the disc reaches sqrt(rho^2 - (v T_s / 2)^2) to the side; sparse samples are
    not followed below a good part of the radius, there the SQP has to find better.
    """
    apart = min(0.5 * speed * period, 0.7 * radius)
    return Swath(float(np.sqrt(radius**2 - apart**2)), radius)


def slow_swath(radius: float) -> Swath:
    """Return the swath of a disc that passes so slowly that many looks are taken of everything in it."""
    return Swath(_SLOW_HALF * radius, radius, _SLOW_INSET)


@dataclass(frozen=True, eq=False)
class Lane:
    """A straight stretch from `low` to `high`, both (d,) [m], along one axis."""

    low: FloatArray
    high: FloatArray


def cut_lanes(cell: FloatArray, swath: Swath, axis: int, count: int = 1) -> list[Lane]:
    """Return lanes along `axis` that together sweep the (K, d) cells [m].

    Lanes are side by side along the other axis (in three dimensions in two layers of other axes, of which
    the last varies slowest). In the plane `count` asks for that many lanes at least.
    """
    others = [a for a in range(cell.shape[1]) if a != axis]
    groups = [cell]
    for other in reversed(others):
        groups = [part for group in groups for part in _bands(group, swath, other, count if len(others) == 1 else 1)]
    return [_lane(group, swath, axis, others) for group in groups]


def _bands(cell: FloatArray, swath: Swath, axis: int, count: int) -> list[FloatArray]:
    """Cut cells into as few bands as the swath allows, each as wide as it may be, or into `count` even ones."""
    place = cell[:, axis]
    rows = np.unique(np.round(place, 9))
    first = [rows[0]]
    while (later := rows[rows > first[-1] + 2.0 * swath.half_width + 1e-9]).size:
        first.append(later[0])
    if count > len(first):
        first = [part[0] for part in np.array_split(rows, min(count, len(rows)))]
    number = np.searchsorted(np.array(first), place + 1e-8, side="right") - 1
    return [cell[number == band] for band in range(len(first)) if (number == band).any()]


def _lane(cell: FloatArray, swath: Swath, axis: int, others: Sequence[int]) -> Lane:
    low, high = np.empty(cell.shape[1]), np.empty(cell.shape[1])
    for other in others:
        low[other] = high[other] = 0.5 * (cell[:, other].min() + cell[:, other].max())
    first, last = cell[:, axis].min(), cell[:, axis].max()
    inset = min(swath.inset * swath.radius, 0.5 * (last - first))
    low[axis], high[axis] = first + inset, last - inset
    return Lane(low, high)


def snake(lanes: Sequence[Lane], start: FloatArray) -> FloatArray:
    """Return (W, d) waypoints through all lanes to and fro, from the corner nearest to `start` (d,) [m]."""
    best: FloatArray | None = None
    for ordered in (list(lanes), list(reversed(lanes))):
        for upward in (True, False):
            path = _to_and_fro(ordered, upward=upward)
            if best is None or np.linalg.norm(path[0] - start) < np.linalg.norm(best[0] - start):
                best = path
    assert best is not None
    return best


def _to_and_fro(lanes: Sequence[Lane], *, upward: bool) -> FloatArray:
    points = []
    for number, lane in enumerate(lanes):
        ends = [lane.low, lane.high] if upward == (number % 2 == 0) else [lane.high, lane.low]
        points += ends
    return np.array(points)


def cut_snake(lanes: Sequence[Lane], share: FloatArray, *, mirrored: bool, upward: bool) -> list[FloatArray]:
    """Cut one path through all lanes into pieces whose lengths go as `share` (P,); returns their waypoints."""
    ordered = list(reversed(lanes)) if mirrored else list(lanes)
    path = _to_and_fro(ordered, upward=upward)
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    cuts = np.concatenate([[0.0], np.cumsum(share) / np.sum(share)]) * at[-1]
    pieces = []
    for low, high in pairwise(cuts):
        ends = np.stack([np.interp([low, high], at, path[:, a]) for a in range(path.shape[1])], axis=1)
        inside = path[(at > low + 1e-6) & (at < high - 1e-6)]
        pieces.append(np.concatenate([ends[:1], inside, ends[1:]]))
    return pieces


def assign_pieces(
    pieces: Sequence[FloatArray], start: FloatArray, speed: FloatArray, *, one_way: bool = False
) -> list[FloatArray]:
    """Return for each of the (m, d) starts the piece it flies, in the better direction, so that all end early.

    `one_way` has all fly in the direction of the whole path: nobody is where two pieces meet at the same time.
    """
    length = np.array([np.linalg.norm(np.diff(piece, axis=0), axis=1).sum() for piece in pieces])
    ends = np.array([[piece[0], piece[-1]] for piece in pieces])
    way = np.linalg.norm(start[:, None, None] - ends[None], axis=3)
    if one_way:
        way = np.repeat(way[:, :, :1], 2, axis=2)
    match = assign_times((way.min(axis=2) + length) / speed[:, None])
    flown = []
    for agent, piece in enumerate(match):
        backward = way[agent, piece, 1] < way[agent, piece, 0]
        flown.append(pieces[piece][::-1] if backward else pieces[piece])
    return flown


def strips(cell: FloatArray, share: FloatArray, axis: int) -> list[FloatArray]:
    """Cut the (K, d) cells into strips across `axis`, the i-th with the part `share[i]` of them."""
    order = np.argsort(cell[:, axis], kind="stable")
    edges = np.round(np.cumsum(share) / np.sum(share) * len(order)).astype(int)
    return [cell[part] for part in np.split(order, edges[:-1])]


def comb(lanes: Sequence[Lane], start: FloatArray, *, mirrored: bool, upward: bool) -> list[FloatArray]:
    """Share out lanes to agents abreast: block after block, all agents side by side.

    `start` is (m, d) [m]. Returns each agent's waypoints. Neighbours stay a lane apart, which keeps a fleet
    together whatever the size of the field. The last block may leave agents over; they fly along.
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
    """Return for each of the (m, d) starts the goal it takes, so that the longest way is short."""
    return assign_times(np.linalg.norm(start[:, None] - goal[None], axis=2))


def assign_times(times: FloatArray) -> list[int]:
    """Return for each row of a square table the column it takes, so that the largest entry, then the sum, is small."""
    if len(times) <= 6:  # noqa: PLR2004 - 720 permutations
        order = list(permutations(range(len(times))))
        table = times[np.arange(len(times)), np.array(order)]
        best = int(np.lexsort((table.sum(axis=1), np.round(table.max(axis=1), 6)))[0])
        return list(order[best])
    _, column = linear_sum_assignment(times**3)
    return [int(c) for c in column]
