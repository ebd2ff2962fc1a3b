"""Disc sensing on cells (thesis 3.23, 4.29)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.look_instants import nearest_part

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray, IntArray

TIE = 1e-9
"""A cell no farther than this beyond rho is measured [m]: rounding does not decide about cells at distance rho. Plain
choice, far below any cell."""
_PIECES = 4
"""Pieces of an interval in each of which the nearest point is sought; a plain choice, as distances have two minima."""
_PAIRS_MAX = 1_000_000
"""Samples times cells whose distances are taken at once, so that they fit into the caches; a plain choice."""
_STRIP = 1.01
"""Half the width, in sensing radii, of the strip of cells along an axis that are looked at; 1 but for rounding."""
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
    if not len(position):
        return count
    order = np.argsort(cell[:, 0], kind="stable")
    for path, reach in zip(np.swapaxes(position, 0, 1), radius, strict=True):
        for some in np.array_split(path, -(-len(path) * len(cell) // _PAIRS_MAX)):
            ends = np.array([some[:, 0].min(), some[:, 0].max()]) + np.array([-_STRIP, _STRIP]) * max(reach.max(), 0.0)
            strip = order[slice(*np.searchsorted(cell[order, 0], ends))]
            distance = np.sqrt(sum((some[:, None, a] - cell[None, strip, a]) ** 2 for a in range(cell.shape[1])))
            for magnitude in np.flatnonzero(reach > 0.0):
                count[magnitude, strip] += np.count_nonzero(distance <= reach[magnitude] + TIE, axis=0)
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
    order = np.argsort(cell[:, 0])
    across = cell[order, 0]
    farthest = _STRIP * np.maximum(radius.max(axis=1), 0.0)
    for t, now in zip(time, position, strict=True):
        low, high = (np.searchsorted(across, now[:, 0] + side * farthest) for side in (-1.0, 1.0))
        for agent in np.flatnonzero(farthest > 0.0):
            strip = order[low[agent] : high[agent]]
            strip = strip[np.isinf(first[:, strip]).any(axis=0)]
            seen = measured(now[[agent]], cell[strip], radius[[agent]])
            first[:, strip] = np.where(seen, np.minimum(first[:, strip], t), first[:, strip])
    return np.asarray(first.max(axis=0))


def passed_at(
    time: FloatArray, position: FloatArray, velocity: FloatArray, cell: FloatArray, radius: FloatArray
) -> FloatArray:
    """Return (K,) [s]: the first of the (T,) sample times by which every magnitude was passed in range, or inf.

    `position` and `velocity` are (T, m, d) [m], [m/s], with constant inputs between samples.
    """
    first = np.full((radius.shape[1], cell.shape[0]), np.inf)
    now = measured(position[0], cell, radius)
    first[now] = time[0]
    farthest = np.maximum(radius.max(axis=1), 0.0)
    for n, step in enumerate(np.diff(time)):
        owed = np.flatnonzero(np.isinf(first).any(axis=0))
        if owed.size == 0:
            break
        for agent in np.flatnonzero(farthest > 0.0):
            motion = position[n, agent], velocity[n, agent], velocity[n + 1, agent]
            reachable = _near_chord(cell[owed], position[n + 1, agent], *motion, step, farthest[agent])
            some = owed[reachable]
            if some.size == 0:
                continue
            distance = _pass_distance(cell[some], *motion, step)
            seen = distance <= radius[agent][:, None] + TIE
            first[:, some] = np.where(seen, np.minimum(first[:, some], time[n + 1]), first[:, some])
    return np.asarray(first.max(axis=0))


def _near_chord(
    cell: FloatArray,
    end: FloatArray,
    start: FloatArray,
    before: FloatArray,
    after: FloatArray,
    step: float,
    reach: float,
) -> BoolArray:
    """Return (K,) whether cells may be within `reach` [m] of a path from `start` to `end` (d,) [m]."""
    middle = 0.5 * (start + end)
    size = 0.5 * float(np.linalg.norm(end - start)) + float(np.linalg.norm(after - before)) * step / 8.0
    return np.asarray(((cell - middle) ** 2).sum(axis=1) <= (reach + size + TIE) ** 2)


def _pass_distance(
    cell: FloatArray, start: FloatArray, before: FloatArray, after: FloatArray, step: float
) -> FloatArray:
    """Return (K,) [m]: the least distances of cells (K, d) [m] to one parabola."""
    edges = np.linspace(0.0, 1.0, _PIECES + 1)
    offset = np.repeat((start - cell)[None], _PIECES, axis=0)
    low, high = (np.repeat(part[:, None], cell.shape[0], axis=1) for part in (edges[:-1], edges[1:]))
    part = nearest_part(
        offset, np.broadcast_to(before, offset.shape), np.broadcast_to(after, offset.shape), step, (low, high)
    )
    later = 0.5 * step * part**2
    away = offset + (step * part - later)[..., None] * before + later[..., None] * after
    return np.asarray(np.linalg.norm(away, axis=2).min(axis=0))


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
