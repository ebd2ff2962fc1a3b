"""Sparse rows of a QP, and the columns of a motion's variables."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class Layout:
    """Columns of positions and velocities at samples 0 to N of m agents in d dimensions.

    All positions come first, then all velocities; within each, sample by sample and agent by agent.
    Inputs are eliminated: u(n) = (v(n+1) - v(n)) / T_s under a zero-order hold.
    """

    steps: int
    agents: int
    dimension: int

    @property
    def half(self) -> int:
        """Number of position columns, and of velocity columns."""
        return (self.steps + 1) * self.agents * self.dimension

    @property
    def size(self) -> int:
        """Number of columns of the motion."""
        return 2 * self.half

    def position(self, sample: IntArray | int, agent: IntArray | int) -> IntArray:
        """Return the column of the first coordinate of q_agent(sample)."""
        return np.asarray((np.asarray(sample) * self.agents + agent) * self.dimension, dtype=np.intp)

    def velocity(self, sample: IntArray | int, agent: IntArray | int) -> IntArray:
        """Return the column of the first coordinate of v_agent(sample)."""
        return self.half + self.position(sample, agent)


@dataclass(frozen=True, eq=False)
class Rows:
    """lower <= A x <= upper for a block of rows, A as triplets with row numbers that start at 0.

    `elastic` is None for hard rows, else the (rows,) index of the slack that relaxes the upper bound of
    each row; slacks are numbered from 0 within the block.
    """

    row: IntArray
    column: IntArray
    value: FloatArray
    lower: FloatArray
    upper: FloatArray
    elastic: IntArray | None = None

    @property
    def count(self) -> int:
        """Number of rows."""
        return int(self.lower.shape[0])

    @property
    def slacks(self) -> int:
        """Number of slacks of the block."""
        return 0 if self.elastic is None or self.elastic.size == 0 else int(self.elastic.max()) + 1


def elastic_rows(column: IntArray, value: FloatArray, upper: FloatArray, slack: IntArray | None = None) -> Rows:
    """Return rows value . x - s <= upper with the same number of entries each.

    `column` and `value` are (rows, entries), `upper` (rows,), `slack` (rows,) the index of each row's slack; by
    default each row has a slack of its own.
    """
    each = np.arange(column.shape[0])
    lower = np.full(each.size, -np.inf)
    slack = each if slack is None else slack
    return Rows(np.repeat(each, column.shape[1]), column.ravel(), value.ravel(), lower, upper, elastic=slack)


def stack(blocks: Sequence[Rows], columns: int) -> tuple[scipy.sparse.csc_array[np.float64], FloatArray, FloatArray]:
    """Stack blocks into one canonical csc matrix (rows, columns) with its lower and upper bounds (rows,)."""
    offsets = np.cumsum([0, *(block.count for block in blocks)])
    row = np.concatenate([block.row + offset for block, offset in zip(blocks, offsets, strict=False)])
    column = np.concatenate([block.column for block in blocks])
    value = np.concatenate([block.value for block in blocks])
    matrix = scipy.sparse.csc_array((value, (row, column)), shape=(int(offsets[-1]), columns))
    matrix.sum_duplicates()
    lower = np.concatenate([block.lower for block in blocks])
    upper = np.concatenate([block.upper for block in blocks])
    return matrix, lower, upper
