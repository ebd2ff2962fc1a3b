"""For every cell and magnitude, the samples of the fleet's motion that are nearest to measuring it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

from mpc_cover.coverage.between_samples import nearest_between
from mpc_cover.coverage.nearest_points import DENSE, FAR, Nearest, padded, pairwise_distance, smallest, taken
from mpc_cover.model.sensing import TIE

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.model.look_instants import InterSample


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
        return nearest_between(position, between, cell, radius, weight, count)
    agents = position.shape[1]
    points = position.reshape(-1, position.shape[2])
    parts = []
    for magnitude in range(radius.shape[1]):
        live = np.flatnonzero(weight[magnitude] > 0.0)
        able = np.flatnonzero(np.isfinite(radius[:, magnitude]))
        columns = (np.arange(position.shape[0])[:, None] * agents + able).ravel()
        reach = np.tile(radius[able, magnitude], position.shape[0])
        if looks is None and live.size * columns.size > DENSE:
            parts.append(_by_tree(points[columns], columns, reach, cell[live], count, live, weight[magnitude, live]))
            continue
        distance = pairwise_distance(cell[live], points[columns])
        excess = distance - reach
        row, keep = _ranked(excess, count, None if looks is None else looks[magnitude, live])
        parts.append(
            Nearest(
                sample=columns[keep],
                distance=taken(distance, row, keep),
                excess=taken(excess, row, keep),
                cell=live[row],
                weight=weight[magnitude, live][row],
            )
        )
    if len(parts) == 1 and parts[0].sample.shape[1] == count:
        return parts[0]
    return Nearest(
        sample=np.concatenate([padded(p.sample, count, 0) for p in parts]).astype(np.intp),
        distance=np.concatenate([padded(p.distance, count, FAR) for p in parts]),
        excess=np.concatenate([padded(p.excess, count, FAR) for p in parts]),
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
        distance, index = scipy.spatial.cKDTree(points[some]).query(cell, k=range(1, wanted + 1))
        samples.append(columns[some][index])
        distances.append(distance)
        excesses.append(distance - radius)
    excess = np.concatenate(excesses, axis=1)
    keep = smallest(excess, count)
    rows = np.arange(cell.shape[0])
    return Nearest(
        sample=taken(np.concatenate(samples, axis=1), rows, keep),
        distance=taken(np.concatenate(distances, axis=1), rows, keep),
        excess=taken(excess, rows, keep),
        cell=live,
        weight=weight,
    )


def _ranked(excess: FloatArray, count: int, looks: IntArray | None) -> tuple[IntArray, IntArray]:
    """Return (R,) rows and (R, count) columns of `excess`: the nearest samples, distributed over each row's looks."""
    if looks is None or (looks == 1).all():
        return np.arange(excess.shape[0]), smallest(excess, count)
    available, rows, columns = excess.shape[1], [], []
    counts = np.unique(looks)
    width = int(np.minimum(-(-available // counts), count).max())
    for required in counts.tolist():
        some = np.flatnonzero(looks == required)
        near = smallest(excess[some], min(required * count, available))
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
