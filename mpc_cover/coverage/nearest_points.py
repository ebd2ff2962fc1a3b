"""The points nearest to cells: their representation, distances, and selections of the smallest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray

Array = TypeVar("Array", "FloatArray", "IntArray")

DENSE = 200_000
"""Pairs of cells and samples above which a k-d tree is used instead of all distances; a plain choice."""
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


def pairwise_distance(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return distances (A, B) [m] between points (A, d) and (B, d) [m]; one component at a time is the fastest."""
    square = np.zeros((a.shape[0], b.shape[0]))
    for axis in range(a.shape[1]):
        difference = a[:, None, axis] - b[None, :, axis]
        difference *= difference
        square += difference
    return np.asarray(np.sqrt(square, out=square))


def smallest(values: FloatArray, count: int) -> IntArray:
    """Return the column indices of the `count` smallest entries of each row."""
    if values.shape[1] <= count:
        return np.broadcast_to(np.arange(values.shape[1]), values.shape)
    return np.argpartition(values, count - 1, axis=1)[:, :count]


def taken(values: Array, row: IntArray, column: IntArray) -> Array:
    """Return the entries of `values` (R, W) in (R,) rows and (R, M) columns."""
    return values[row[:, None], column]


def padded(values: FloatArray | IntArray, count: int, filler: float) -> FloatArray:
    """Return values (R, W) with `count` columns, the missing ones filled."""
    missing = count - values.shape[1]
    return np.pad(values.astype(float), ((0, 0), (0, missing)), constant_values=filler)
