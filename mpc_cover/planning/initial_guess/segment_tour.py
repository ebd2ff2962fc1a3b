"""A short open tour over lanes: each is flown from one end to the other, in either direction (2-opt and Or-opt).

Nearest neighbour, then the best improving move until there is none: reversing a part of the tour, or moving a few lanes
elsewhere (Croes, Operations Research 6, 1958; Or 1976).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.coverage.nearest_points import pairwise_distance

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray

_LANES_MAX = 400
"""Lanes up to which a tour is improved: a move compares all pairs of them. Plain choice."""
_MOVES_PER_LANE = 2
"""Moves per lane at most; a plain choice, more than observed."""
_BLOCK = 3
"""Lanes that are moved together at most, as in Or's method."""
_GAIN_MIN = 1e-9
"""Relative gain below which a move is rounding; a plain choice."""


def segment_tour(lanes: FloatArray, start: FloatArray) -> FloatArray:
    """Return the (L, 2, d) lanes [m] in the order and the directions of a short tour that begins near `start` (d,)."""
    tour = _nearest_neighbour(lanes, start)
    if 1 < len(tour) <= _LANES_MAX:
        scale = _GAIN_MIN * max(float(np.abs(tour - tour[0, 0]).max()), np.finfo(float).tiny)
        for _ in range(_MOVES_PER_LANE * len(tour)):
            gain, moved = _best_reversal(tour)
            if gain <= scale:
                gain, moved = _best_transfer(tour)
            if gain <= scale:
                break
            tour = moved
    return tour


def _nearest_neighbour(lanes: FloatArray, start: FloatArray) -> FloatArray:
    left, here, tour = np.arange(len(lanes)), start, []
    while left.size:
        distance = np.linalg.norm(lanes[left] - here, axis=2)
        lane, end = divmod(int(np.argmin(distance)), 2)
        chosen = lanes[left[lane]][:: -1 if end else 1]
        tour.append(chosen)
        here, left = chosen[1], np.delete(left, lane)
    return np.array(tour)


def _gaps(tour: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (L+1,) lengths [m] of the links before each lane and after the last; those at the ends are 0."""
    link = np.concatenate([[0.0], np.linalg.norm(tour[1:, 0] - tour[:-1, 1], axis=1), [0.0]])
    return link[:-1], link[1:]


def _best_reversal(tour: FloatArray) -> tuple[float, FloatArray]:
    """Return the gain [m] of the best reversal of the lanes i to j, and the tour after it."""
    first, last = tour[:, 0], tour[:, 1]
    before, after = _gaps(tour)
    to_last = np.vstack([np.zeros(len(tour)), pairwise_distance(last[:-1], last)])  # (i, j): before i to the end of j
    to_first = np.hstack([pairwise_distance(first, first[1:]), np.zeros((len(tour), 1))])  # (i, j): i to after j
    gain = np.triu(before[:, None] + after[None] - to_last - to_first)
    i, j = divmod(int(np.argmax(gain)), len(tour))
    return float(gain[i, j]), np.concatenate([tour[:i], tour[i : j + 1][::-1, ::-1], tour[j + 1 :]])


def _best_transfer(tour: FloatArray) -> tuple[float, FloatArray]:
    """Return the gain [m] of the best transfer of up to `_BLOCK` lanes between two others, and the tour after it."""
    best, moved = 0.0, tour
    for size in range(1, min(_BLOCK, len(tour) - 1) + 1):
        count = len(tour) - size + 1
        place = np.arange(len(tour) + 1)  # before lane `place`
        begin = np.arange(count)
        link = np.concatenate([_gaps(tour)[0], [0.0]])
        closed = np.zeros(count)
        closed[1:-1] = np.linalg.norm(tour[size + 1 :, 0] - tour[: count - 2, 1], axis=1)
        removed = link[begin] + link[begin + size] - closed
        inside = (place >= begin[:, None]) & (place <= begin[:, None] + size)
        for turned in (False, True):
            head, tail = (tour[size - 1 :, 1], tour[:count, 0]) if turned else (tour[:count, 0], tour[size - 1 :, 1])
            added = np.zeros((count, len(tour) + 1))
            added[:, 1:] += pairwise_distance(head, tour[:, 1])
            added[:, :-1] += pairwise_distance(tail, tour[:, 0])
            gain = np.where(inside, -np.inf, removed[:, None] - (added - link))
            i, p = divmod(int(np.argmax(gain)), len(tour) + 1)
            if gain[i, p] > best:
                best, block = float(gain[i, p]), tour[i : i + size]
                block = block[::-1, ::-1] if turned else block
                parts = [tour[:p], block, tour[p:i], tour[i + size :]]
                if p > i:
                    parts = [tour[:i], tour[i + size : p], block, tour[p:]]
                moved = np.concatenate(parts)
    return best, moved
