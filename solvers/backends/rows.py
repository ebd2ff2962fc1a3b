"""Classification of the rows l <= A x <= u, and conversion to the layouts of native solvers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from solvers.checks import column_of_each_entry

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

UPPER, LOWER, EQUAL = 1, 2, 4
"""Kinds of rows, as flags: finite upper bound, finite lower bound; equality."""


def row_kinds(lower: NDArray[np.float64], upper: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return for each row EQUAL, or which of UPPER and LOWER are finite (their sum; 0: a free row)."""
    kinds: NDArray[np.uint8] = (UPPER * np.isfinite(upper) + LOWER * np.isfinite(lower)).astype(np.uint8)
    kinds[lower == upper] = EQUAL
    return kinds


@dataclass(frozen=True)
class StackedRows:
    """Rows of a csc matrix, some negated, stacked into a csc matrix whose values can be refreshed.

    Attributes
    ----------
    matrix: the stack; `refresh` writes into its data.
    source: for each entry, its index in the data of the original matrices.
    sign: +1 or -1 for each entry.
    """

    matrix: scipy.sparse.csc_matrix[np.float64]
    source: NDArray[np.intp]
    sign: NDArray[np.float64]

    def refresh(self, data: NDArray[np.float64]) -> None:
        """Take the values from `data`, the concatenated data of the original matrices."""
        # mode="clip" avoids the buffered copy of the default, which must be able to raise
        np.take(data, self.source, out=self.matrix.data, mode="clip")
        self.matrix.data *= self.sign


@dataclass(frozen=True)
class Block:
    """Some rows of a matrix, times a sign; `offset` is the index of its first value in the data for `refresh`."""

    matrix: scipy.sparse.csc_array[np.float64]
    rows: NDArray[np.intp]
    sign: float
    offset: int = 0


def stack_rows(blocks: Sequence[Block], data: NDArray[np.float64]) -> StackedRows:
    """Return the blocks stacked vertically, with the values of `data`."""
    width = blocks[0].matrix.shape[1]
    rows, columns, sources, signs = [], [], [], []
    height = 0
    for block in blocks:
        place = np.full(block.matrix.shape[0], -1)
        place[block.rows] = np.arange(height, height + block.rows.size)
        taken = np.flatnonzero(place[block.matrix.indices] >= 0)
        rows.append(place[block.matrix.indices[taken]])
        columns.append(column_of_each_entry(block.matrix)[taken])
        sources.append(taken + block.offset)
        signs.append(np.full(taken.size, block.sign))
        height += block.rows.size
    row, column = np.concatenate(rows), np.concatenate(columns)
    order = np.lexsort((row, column))
    # native layouts hold int32 indices: others would be converted at every call
    indptr = np.concatenate(([0], np.cumsum(np.bincount(column, minlength=width)))).astype(np.int32)
    entries = (np.empty(row.size), row[order].astype(np.int32), indptr)
    stacked = scipy.sparse.csc_matrix(entries, shape=(height, width))
    result = StackedRows(stacked, np.concatenate(sources)[order], np.concatenate(signs)[order])
    result.refresh(data)
    return result


def native_csc(matrix: scipy.sparse.csc_array[np.float64]) -> scipy.sparse.csc_matrix[np.float64]:
    """Return a csc_matrix with int32 indices that shares the data (native bindings do not accept csc_array)."""
    return scipy.sparse.csc_matrix(
        (matrix.data, matrix.indices.astype(np.int32), matrix.indptr.astype(np.int32)), shape=matrix.shape
    )
