"""Disc sensing on cells (thesis 3.23, 4.29)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray, IntArray

TIE = 1e-9
"""A cell no farther than this beyond rho is measured [m]: rounding does not decide about cells at distance rho. Plain
choice, far below any cell."""
_PERIOD_ROUNDING = 1e-6
"""Looks closer than a period by less than this part of it count as a period apart; a plain choice."""


def measured(position: FloatArray, cell: FloatArray, radius: FloatArray) -> BoolArray:
    """Return (J, K): which magnitude is measured on which cell by a fleet at (m, d) positions [m].

    `cell` is (K, d) [m]; `radius` (m, J) [m], -inf where an agent cannot measure a magnitude (4.29).
    """
    distance = np.linalg.norm(position[:, None, :] - cell[None], axis=2)
    return np.asarray((distance[:, None, :] <= radius[:, :, None] + TIE).any(axis=0))


def look_counts(position: FloatArray, cell: FloatArray, radius: FloatArray) -> IntArray:
    """Return (J, K): how many samples of a motion (N+1, m, d) [m] measure each cell, summed over the agents.

    `cell` is (K, d) [m]; `radius` (m, J) [m], -inf where an agent cannot measure a magnitude.
    """
    count = np.zeros((radius.shape[1], cell.shape[0]), dtype=np.intp)
    for path, reach in zip(np.swapaxes(position, 0, 1), radius, strict=True):
        distance = np.sqrt(sum((path[:, None, a] - cell[None, :, a]) ** 2 for a in range(cell.shape[1])))
        for magnitude in np.flatnonzero(reach > 0.0):
            count[magnitude] += np.count_nonzero(distance <= reach[magnitude] + TIE, axis=0)
    return count


def covered_at(
    time: FloatArray,
    position: FloatArray,
    cell: FloatArray,
    radius: FloatArray,
    looks: int = 1,
    period: float = 0.0,
) -> FloatArray:
    """Return (K,) [s]: the first of the (T,) sample times by which every magnitude was measured; inf where never.

    `position` is (T, m, d) [m]. If several `looks` are required, the same agent's looks at a cell count only if they
    are at least a `period` [s] apart.
    """
    if looks > 1:
        return _looked_at(time, position, cell, radius, looks, period)
    first = np.full((radius.shape[1], cell.shape[0]), np.inf)
    for t, now in zip(time, position, strict=True):
        first = np.where(measured(now, cell, radius), np.minimum(first, t), first)
    return np.asarray(first.max(axis=0))


def _looked_at(
    time: FloatArray, position: FloatArray, cell: FloatArray, radius: FloatArray, looks: int, period: float
) -> FloatArray:
    agents, magnitudes = radius.shape
    last = np.full((agents, magnitudes, cell.shape[0]), -np.inf)
    count = np.zeros((magnitudes, cell.shape[0]), dtype=int)
    first = np.full(count.shape, np.inf)
    for t, now in zip(time, position, strict=True):
        distance = np.linalg.norm(now[:, None, :] - cell[None], axis=2)
        seen = (distance[:, None, :] <= radius[:, :, None] + TIE) & (t - last >= period * (1.0 - _PERIOD_ROUNDING))
        last[seen] = t
        count += seen.sum(axis=0)
        first = np.where((count >= looks) & np.isinf(first), t, first)
    return np.asarray(first.max(axis=0))
