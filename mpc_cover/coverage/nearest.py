"""For every cell and magnitude, the samples of the fleet's motion that come nearest to measuring it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray

FAR = 1e9
"""Stands for "never" where fewer samples than asked for can measure a magnitude [m]."""


@dataclass(frozen=True, eq=False)
class Nearest:
    """The M nearest samples of R looks at pairs (magnitude, cell) that are still owed.

    A pair that is owed r looks stands here r times: of its nearest samples the first, the r+1st, ... belong to
    the first look, the second, the r+2nd, ... to the second, and so on. The looks share no sample, so the
    sum of their minima is never less than the sum of the r smallest, and equal to it when ranked anew.

    Attributes
    ----------
    sample : (R, M) index n * m + i of sample n of agent i.
    distance : (R, M) Euclidean distance [m].
    excess : (R, M) distance - rho_j^(i) [m], what (4.34) takes the minimum of.
    cell : (R,) index of the cell.
    weight : (R,) gamma_jk.
    """

    sample: IntArray
    distance: FloatArray
    excess: FloatArray
    cell: IntArray
    weight: FloatArray


def nearest_samples(
    position: FloatArray,
    cell: FloatArray,
    radius: FloatArray,
    weight: FloatArray,
    count: int,
    looks: IntArray | None = None,
) -> Nearest:
    """Find the `count` samples of smallest excess for each look at a pair with a positive weight.

    `position` is (N+1, m, d) [m]; `cell` (K, d) [m]; `radius` (m, J) [m], -inf where an agent cannot
    measure a magnitude; `weight` (J, K); `looks` (J, K), None for one look each.
    """
    agents = position.shape[1]
    points = position.reshape(-1, position.shape[2])
    parts = []
    for magnitude in range(radius.shape[1]):
        live = np.flatnonzero(weight[magnitude] > 0.0)
        able = np.flatnonzero(np.isfinite(radius[:, magnitude]))
        columns = (np.arange(position.shape[0])[:, None] * agents + able).ravel()
        reach = np.tile(radius[able, magnitude], position.shape[0])
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


def pairwise_distance(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return (A, B) [m] distances between points (A, d) and (B, d); a component at a time is the fastest."""
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
    """Return (R,) rows and (R, count) columns of `excess`: the nearest samples, dealt out to the looks of each row."""
    if looks is None or (looks == 1).all():
        return np.arange(excess.shape[0]), _smallest(excess, count)
    rows, columns = [], []
    for owed in np.unique(looks):
        some = np.flatnonzero(looks == owed)
        wanted = min(int(owed) * count, excess.shape[1])
        near = _smallest(excess[some], wanted)
        order = np.argsort(np.take_along_axis(excess[some], near, axis=1), axis=1, kind="stable")
        ranked = np.take_along_axis(near, order, axis=1)
        for look in range(min(int(owed), excess.shape[1])):
            rows.append(some)
            columns.append(ranked[:, look :: int(owed)][:, :count])
    width = max(part.shape[1] for part in columns)
    # a look with fewer samples than others repeats its last: a minimum does not change by that
    even = [np.pad(part, ((0, 0), (0, width - part.shape[1])), mode="edge") for part in columns]
    return np.concatenate(rows), np.concatenate(even)


def _taken(values: FloatArray, row: IntArray, column: IntArray) -> FloatArray:
    return values[row[:, None], column]


def _pad(values: FloatArray | IntArray, count: int, filler: float) -> FloatArray:
    missing = count - values.shape[1]
    return np.pad(values.astype(float), ((0, 0), (0, missing)), constant_values=filler)
