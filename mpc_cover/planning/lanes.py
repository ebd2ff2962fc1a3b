"""Paths that sweep what is owed: lanes a sensing disc wide, in strips of equal work or abreast like a comb."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import FloatArray

_OVERLAP = 0.92
"""Lanes are this part of the sensing diameter wide: discs of finitely many samples leave a ragged edge."""
_INSET = 0.75
"""Lanes end this part of the radius before the last cell."""


@dataclass(frozen=True, eq=False)
class Lane:
    """A straight stretch from `low` to `high`, both (d,) [m], along one axis."""

    low: FloatArray
    high: FloatArray


def cut_lanes(cell: FloatArray, radius: float, axis: int, count: int | None = None) -> list[Lane]:
    """Return lanes along `axis` that together sweep the (K, d) cells [m] with a disc of `radius` [m].

    Lanes are side by side along the other axis (in three dimensions in two layers of other axes, of which
    the last varies slowest). `count` asks for that many lanes at least.
    """
    others = [a for a in range(cell.shape[1]) if a != axis]
    groups = [cell]
    wanted = count if len(others) == 1 else None
    for other in reversed(others):
        groups = [part for group in groups for part in _bands(group, radius, other, wanted)]
    return [_lane(group, radius, axis, others) for group in groups]


def _bands(cell: FloatArray, radius: float, axis: int, count: int | None) -> list[FloatArray]:
    low, high = cell[:, axis].min(), cell[:, axis].max()
    width = 2.0 * radius * _OVERLAP
    bands = max(1, int(np.ceil((high - low) / width)), count or 1)
    number = np.minimum(((cell[:, axis] - low) / max(high - low, 1e-9) * bands).astype(int), bands - 1)
    return [cell[number == band] for band in range(bands) if (number == band).any()]


def _lane(cell: FloatArray, radius: float, axis: int, others: Sequence[int]) -> Lane:
    low, high = np.empty(cell.shape[1]), np.empty(cell.shape[1])
    for other in others:
        low[other] = high[other] = 0.5 * (cell[:, other].min() + cell[:, other].max())
    first, last = cell[:, axis].min(), cell[:, axis].max()
    inset = min(_INSET * radius, 0.5 * (last - first))
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
    distance = np.linalg.norm(start[:, None] - goal[None], axis=2)
    if len(start) <= 6:  # noqa: PLR2004 - 720 permutations
        order = list(permutations(range(len(start))))
        table = distance[np.arange(len(start)), np.array(order)]
        best = int(np.lexsort((table.sum(axis=1), np.round(table.max(axis=1), 6)))[0])
        return list(order[best])
    _, column = linear_sum_assignment(distance**2)
    return [int(c) for c in column]
