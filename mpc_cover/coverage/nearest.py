"""For every cell and magnitude, the samples of the fleet's motion that are nearest to measuring it.

Where looks count between samples, too, each interval stands for its point that is nearest to the cell: one for a sample
and an agent, so that the soft minimum weighs passes against each other and not the points of one pass.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from scipy.spatial import cKDTree

from mpc_cover.model.look_instants import nearest_part
from mpc_cover.model.sensing import TIE

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.model.look_instants import InterSample

Array = TypeVar("Array", "FloatArray", "IntArray")

_DENSE = 200_000
"""Pairs of cells and samples above which a k-d tree is used instead of all distances; a plain choice."""
_POINTS_PER_INTERVAL = 3
"""Points that a k-d tree is asked for of each interval wanted, if it has as many; a plain choice."""
_RIVALS = 4
"""Least number of intervals whose nearest points are compared exactly, as inexact ones may be in another order. Plain
choice."""
FAR = 1e9
"""Distance of the missing samples where fewer than requested can measure a magnitude [m]; beyond any mission's size."""


@dataclass(frozen=True, eq=False)
class Nearest:
    """The M nearest samples of each of R outstanding looks, at pairs (magnitude, cell).

    A pair with r outstanding looks has r rows: of its nearest samples the first, the r+1st, ... belong to
    the first look, the second, the r+2nd, ... to the second, and so on. The looks share no sample, so the
    sum of their minima is never less than the sum of the r smallest, and equal to it when ranked again.

    Attributes
    ----------
    sample : (R, M) index n * m + i of sample n of agent i.
    distance : (R, M) Euclidean distance [m].
    excess : (R, M) distance - rho_j^(i) [m], of which (4.34) takes the minimum.
    cell : (R,) index of the cell.
    weight : (R,) gamma_jk.
    part : (R, M) s in [0, 1], how far into the interval after its sample the point lies; None where all are samples.
    """

    sample: IntArray
    distance: FloatArray
    excess: FloatArray
    cell: IntArray
    weight: FloatArray
    part: FloatArray | None = None


def nearest_samples(
    position: FloatArray,
    cell: FloatArray,
    radius: FloatArray,
    weight: FloatArray,
    count: int,
    looks: IntArray | None = None,
    between: InterSample | None = None,
) -> Nearest:
    """Return the `count` samples of smallest excess for each look at a pair with a positive weight.

    `position` is (N+1, m, d) [m]; `cell` (K, d) [m]; `radius` (m, J) [m], -inf where an agent cannot
    measure a magnitude; `weight` (J, K); `looks` (J, K) outstanding, None for one each. `between` are the looks between
    samples; None for none. Where several looks at a cell are outstanding, those at samples alone count.
    """
    if between is not None and looks is None:
        return _nearest_points(position, between, cell, radius, weight, count)
    agents = position.shape[1]
    points = position.reshape(-1, position.shape[2])
    parts = []
    for magnitude in range(radius.shape[1]):
        live = np.flatnonzero(weight[magnitude] > 0.0)
        able = np.flatnonzero(np.isfinite(radius[:, magnitude]))
        columns = (np.arange(position.shape[0])[:, None] * agents + able).ravel()
        reach = np.tile(radius[able, magnitude], position.shape[0])
        if looks is None and live.size * columns.size > _DENSE:
            parts.append(_by_tree(points[columns], columns, reach, cell[live], count, live, weight[magnitude, live]))
            continue
        distance = pairwise_distance(cell[live], points[columns])
        excess = distance - reach
        row, keep = _ranked(excess, count, None if looks is None else looks[magnitude, live])
        parts.append(
            Nearest(
                sample=columns[keep],
                distance=_taken(distance, row, keep),
                excess=_taken(excess, row, keep),
                cell=live[row],
                weight=weight[magnitude, live][row],
            )
        )
    if len(parts) == 1 and parts[0].sample.shape[1] == count:
        return parts[0]
    return Nearest(
        sample=np.concatenate([_pad(p.sample, count, 0) for p in parts]).astype(np.intp),
        distance=np.concatenate([_pad(p.distance, count, FAR) for p in parts]),
        excess=np.concatenate([_pad(p.excess, count, FAR) for p in parts]),
        cell=np.concatenate([p.cell for p in parts]),
        weight=np.concatenate([p.weight for p in parts]),
    )


def remaining_weight(
    position: FloatArray,
    cell: FloatArray,
    radius: FloatArray,
    weight: FloatArray,
    between: InterSample | None = None,
) -> FloatArray:
    """Return the weights (J, K) that remain after a motion (N+1, m, d) [m]: 0 where it measures; N+1 may be 0.

    `cell` is (K, d) [m]; `radius` (m, J) [m]; `weight` (J, K) before the motion; `between` as in `nearest_samples`.
    """
    left = weight.copy()
    if position.shape[0] == 0 or not (weight > 0.0).any():
        return left
    for magnitude in range(weight.shape[0]):
        one = nearest_samples(position, cell, radius[:, [magnitude]], weight[[magnitude]], 1, between=between)
        left[magnitude, one.cell[one.excess[:, 0] <= TIE]] = 0.0
    return left


def _nearest_points(
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
        dense = live.size * able.size <= _DENSE
        search = _points_of_intervals if dense else _points_by_tree
        distance, excess, sample, where = search(cell[live], *some, width)
        found.append(Nearest(sample, distance, excess, live, weight[magnitude, live], where))
    joined = Nearest(
        sample=np.concatenate([_pad(one.sample, wanted, 0) for one in found]).astype(np.intp),
        distance=np.concatenate([_pad(one.distance, wanted, FAR) for one in found]),
        excess=np.concatenate([_pad(one.excess, wanted, FAR) for one in found]),
        cell=np.concatenate([one.cell for one in found]),
        weight=np.concatenate([one.weight for one in found]),
        part=np.concatenate([_pad(one.part, wanted, 0.0) for one in found if one.part is not None]),
    )
    if not between.instants.continuous:
        return joined
    return _fewest(_refined(joined, position, between, cell, 1.0 / parts.size), count)


def _fewest(found: Nearest, count: int) -> Nearest:
    """Return the `count` points of smallest excess of each row."""
    if found.sample.shape[1] == count or found.part is None:
        return found
    keep, row = _smallest(found.excess, count), np.arange(found.cell.size)
    sample, distance = _taken(found.sample, row, keep), _taken(found.distance, row, keep)
    excess, part = _taken(found.excess, row, keep), _taken(found.part, row, keep)
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
    keep, row = _smallest(excess, width), np.arange(cell.shape[0])
    return _taken(distance, row, keep), _taken(excess, row, keep), own[keep], _taken(where, row, keep)


def _points_by_tree(
    cell: FloatArray, point: FloatArray, owner: IntArray, part: FloatArray, reach: FloatArray, width: int
) -> tuple[FloatArray, FloatArray, IntArray, FloatArray]:
    """Return as `_points_of_intervals`, by k-d trees; fewer than `width` intervals may be found, the rest is far."""
    index, distance = [], []
    for radius in np.unique(reach):
        some = np.flatnonzero(reach == radius)
        wanted = min(width * min(np.unique(part).size, _POINTS_PER_INTERVAL), some.size)
        away, near = cKDTree(point[some]).query(cell, k=range(1, wanted + 1))
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
    keep, row = _smallest(excess, width), np.arange(cell.shape[0])
    return _taken(away, row, keep), _taken(excess, row, keep), _taken(own, row, keep), _taken(part[every], row, keep)


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


def _by_tree(
    points: FloatArray,
    columns: IntArray,
    reach: FloatArray,
    cell: FloatArray,
    count: int,
    live: IntArray,
    weight: FloatArray,
) -> Nearest:
    """Return the nearest samples of many pairs: one k-d tree for each radius, results merged."""
    samples, distances, excesses = [], [], []
    for radius in np.unique(reach):
        some = np.flatnonzero(reach == radius)
        wanted = min(count, some.size)
        distance, index = cKDTree(points[some]).query(cell, k=range(1, wanted + 1))
        samples.append(columns[some][index])
        distances.append(distance)
        excesses.append(distance - radius)
    excess = np.concatenate(excesses, axis=1)
    keep = _smallest(excess, count)
    rows = np.arange(cell.shape[0])
    return Nearest(
        sample=_taken(np.concatenate(samples, axis=1), rows, keep),
        distance=_taken(np.concatenate(distances, axis=1), rows, keep),
        excess=_taken(excess, rows, keep),
        cell=live,
        weight=weight,
    )


def pairwise_distance(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return distances (A, B) [m] between points (A, d) and (B, d) [m]; one component at a time is the fastest."""
    square = np.zeros((a.shape[0], b.shape[0]))
    for axis in range(a.shape[1]):
        difference = a[:, None, axis] - b[None, :, axis]
        difference *= difference
        square += difference
    return np.asarray(np.sqrt(square, out=square))


def _smallest(values: FloatArray, count: int) -> IntArray:
    """Return the column indices of the `count` smallest entries of each row."""
    if values.shape[1] <= count:
        return np.broadcast_to(np.arange(values.shape[1]), values.shape)
    return np.argpartition(values, count - 1, axis=1)[:, :count]


def _ranked(excess: FloatArray, count: int, looks: IntArray | None) -> tuple[IntArray, IntArray]:
    """Return (R,) rows and (R, count) columns of `excess`: the nearest samples, distributed over each row's looks."""
    if looks is None or (looks == 1).all():
        return np.arange(excess.shape[0]), _smallest(excess, count)
    available, rows, columns = excess.shape[1], [], []
    counts = np.unique(looks)
    width = int(np.minimum(-(-available // counts), count).max())
    for required in counts.tolist():
        some = np.flatnonzero(looks == required)
        near = _smallest(excess[some], min(required * count, available))
        order = np.argsort(np.take_along_axis(excess[some], near, axis=1), axis=1, kind="stable")
        ranked = np.take_along_axis(near, order, axis=1)[
            :, _distribution(required, min(required * count, available), width)
        ]
        rows.append(np.tile(some, ranked.shape[1]))
        columns.append(np.swapaxes(ranked, 0, 1).reshape(-1, width))
    return np.concatenate(rows), np.concatenate(columns)


def _distribution(required: int, available: int, width: int) -> IntArray:
    """Return (looks, width): which of the `available` ranked samples each of the outstanding looks gets.

    A look with fewer samples than others repeats its last, which leaves the minimum unchanged.
    """
    look = np.arange(min(required, available))[:, None]
    most = (available - 1 - look) // required
    return np.asarray(look + required * np.minimum(np.arange(width), most))


def _taken(values: Array, row: IntArray, column: IntArray) -> Array:
    return values[row[:, None], column]


def _pad(values: FloatArray | IntArray, count: int, filler: float) -> FloatArray:
    missing = count - values.shape[1]
    return np.pad(values.astype(float), ((0, 0), (0, missing)), constant_values=filler)
