"""The points of a motion, also between its samples, that are nearest to measuring each cell and magnitude.

Each interval stands for its point that is nearest to the cell: one for a sample and an agent, so that the soft minimum
weighs passes against each other and not the points of one pass.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from mpc_cover.coverage.nearest_points import DENSE, FAR, Nearest, padded, pairwise_distance, smallest, taken
from mpc_cover.model.look_instants import nearest_part

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.model.look_instants import InterSample

_POINTS_PER_INTERVAL = 3
"""Points that a k-d tree is asked for of each interval wanted, if it has as many; a plain choice."""
_RIVALS = 4
"""Least number of intervals whose nearest points are compared exactly, as inexact ones may be in another order. Plain
choice."""


def nearest_between(
    position: FloatArray,
    between: InterSample,
    cell: FloatArray,
    radius: FloatArray,
    weight: FloatArray,
    count: int,
) -> Nearest:
    """Return for each pair the `count` intervals with the points of smallest excess, a sample and agent each."""
    samples, agents, dimension = position.shape
    wanted = max(count, _RIVALS) if between.instants.continuous else count
    finite = radius[np.isfinite(radius)]
    parts = between.parts(float(finite.min())) if finite.size else np.zeros(1)
    points = [position, *(between.points(position, part) for part in parts[1:])]
    point = np.concatenate([one.reshape(-1, dimension) for one in points])
    owner = np.concatenate([np.arange(one.shape[0] * agents) for one in points])
    part = np.repeat(parts, [one.shape[0] * agents for one in points])
    found = []
    for magnitude in range(radius.shape[1]):
        live = np.flatnonzero(weight[magnitude] > 0.0)
        reach = radius[owner % agents, magnitude]
        able = np.flatnonzero(np.isfinite(reach))
        some = (point[able], owner[able], part[able], reach[able])
        width = min(wanted, int(np.isfinite(radius[:, magnitude]).sum()) * samples)
        dense = live.size * able.size <= DENSE
        search = _points_of_intervals if dense else _points_by_tree
        distance, excess, sample, where = search(cell[live], *some, width)
        found.append(Nearest(sample, distance, excess, live, weight[magnitude, live], where))
    joined = Nearest(
        sample=np.concatenate([padded(one.sample, wanted, 0) for one in found]).astype(np.intp),
        distance=np.concatenate([padded(one.distance, wanted, FAR) for one in found]),
        excess=np.concatenate([padded(one.excess, wanted, FAR) for one in found]),
        cell=np.concatenate([one.cell for one in found]),
        weight=np.concatenate([one.weight for one in found]),
        part=np.concatenate([padded(one.part, wanted, 0.0) for one in found if one.part is not None]),
    )
    if not between.instants.continuous:
        return joined
    return _fewest(_refined(joined, position, between, cell, 1.0 / parts.size), count)


def _fewest(found: Nearest, count: int) -> Nearest:
    """Return the `count` points of smallest excess of each row."""
    if found.sample.shape[1] == count or found.part is None:
        return found
    keep, row = smallest(found.excess, count), np.arange(found.cell.size)
    sample, distance = taken(found.sample, row, keep), taken(found.distance, row, keep)
    excess, part = taken(found.excess, row, keep), taken(found.part, row, keep)
    return replace(found, sample=sample, distance=distance, excess=excess, part=part)


def _points_of_intervals(
    cell: FloatArray, point: FloatArray, owner: IntArray, part: FloatArray, reach: FloatArray, width: int
) -> tuple[FloatArray, FloatArray, IntArray, FloatArray]:
    """Return (distance, excess, sample, part), each (K, width), of the best points of the best intervals."""
    own, first = np.unique(owner, return_index=True)
    distance = np.full((cell.shape[0], own.size), FAR)
    where = np.zeros_like(distance)
    column = np.searchsorted(own, owner)
    for value in np.unique(part):
        some = np.flatnonzero(part == value)
        now = pairwise_distance(cell, point[some])
        target = column[some]
        nearer = now < distance[:, target]
        distance[:, target] = np.where(nearer, now, distance[:, target])
        where[:, target] = np.where(nearer, value, where[:, target])
    excess = distance - reach[first]
    keep, row = smallest(excess, width), np.arange(cell.shape[0])
    return taken(distance, row, keep), taken(excess, row, keep), own[keep], taken(where, row, keep)


def _points_by_tree(
    cell: FloatArray, point: FloatArray, owner: IntArray, part: FloatArray, reach: FloatArray, width: int
) -> tuple[FloatArray, FloatArray, IntArray, FloatArray]:
    """Return as `_points_of_intervals`, by k-d trees; fewer than `width` intervals may be found, the rest is far."""
    index, distance = [], []
    for radius in np.unique(reach):
        some = np.flatnonzero(reach == radius)
        wanted = min(width * min(np.unique(part).size, _POINTS_PER_INTERVAL), some.size)
        away, near = scipy.spatial.cKDTree(point[some]).query(cell, k=range(1, wanted + 1))
        index.append(some[near])
        distance.append(away)
    every, away = np.concatenate(index, axis=1), np.concatenate(distance, axis=1)
    excess = away - reach[every]
    order = np.argsort(excess, axis=1, kind="stable")
    every, away, excess = (np.take_along_axis(values, order, axis=1) for values in (every, away, excess))
    own = owner[every]
    again = np.zeros(own.shape, dtype=bool)
    for column in range(1, own.shape[1]):
        again[:, column] = (own[:, :column] == own[:, column, None]).any(axis=1)
    away, excess = np.where(again, FAR, away), np.where(again, FAR, excess)
    keep, row = smallest(excess, width), np.arange(cell.shape[0])
    return taken(away, row, keep), taken(excess, row, keep), taken(own, row, keep), taken(part[every], row, keep)


def _refined(found: Nearest, position: FloatArray, between: InterSample, cell: FloatArray, apart: float) -> Nearest:
    """Return the nearest points of the same intervals, no farther than those found, which are `apart` in s."""
    assert found.part is not None
    before, after = between.flat()
    last = found.sample >= position[:-1, :, 0].size
    low = np.where(last, 0.0, np.maximum(found.part - apart, 0.0))
    high = np.where(last, 0.0, np.minimum(found.part + apart, 1.0))
    offset = position.reshape(-1, position.shape[2])[found.sample] - cell[found.cell][:, None]
    motion = offset, before[found.sample], after[found.sample]
    part = nearest_part(*motion, between.period, (low, high))
    a, b = between.blend(part)
    distance = np.linalg.norm(motion[0] + a[..., None] * motion[1] + b[..., None] * motion[2], axis=2)
    better = distance < found.distance
    gain = np.where(better, found.distance - distance, 0.0)
    return replace(
        found,
        part=np.where(better, part, found.part),
        distance=found.distance - gain,
        excess=np.where(found.excess < FAR, found.excess - gain, FAR),
    )
