"""The slacks of a subproblem: their columns, bounds, and values at the iterate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.rows import Rows

if TYPE_CHECKING:
    import scipy.sparse as sp

    from mpc_cover.arrays import FloatArray
    from solvers.qp import SecondOrderCones


def with_edge_slacks(start: FloatArray, cones: SecondOrderCones, dimension: int) -> FloatArray:
    """Return the starting point with the slacks that its edges beyond the range require."""
    value = (cones.h + cones.G @ start).reshape(-1, 1 + dimension)
    over = np.maximum(np.linalg.norm(value[:, 1:], axis=1) - value[:, 0], 0.0)
    top = (1 + dimension) * np.arange(over.size)
    lifted = cones.G[top].tocoo()
    start = start.copy()
    start[lifted.col] += over[lifted.row]
    return start


def number_slacks(blocks: list[Rows], first: int) -> tuple[list[Rows], int]:
    """Return elastic rows with an entry -1 in the column of their slack, and the number of slacks."""
    numbered, used = [], 0
    for block in blocks:
        if block.elastic is None or block.count == 0:
            continue
        column = first + used + block.elastic
        numbered.append(
            Rows(
                row=np.concatenate([block.row, np.arange(block.count)]),
                column=np.concatenate([block.column, column]),
                value=np.concatenate([block.value, np.full(block.count, -1.0)]),
                lower=block.lower,
                upper=block.upper,
            )
        )
        used += block.slacks
    return numbered, used


def non_negative(first: int, slacks: int) -> Rows:
    """Return the rows s >= 0 for so many slacks from column `first` on."""
    each = np.arange(slacks)
    return Rows(each, first + each, np.ones(slacks), np.zeros(slacks), np.full(slacks, np.inf))


def slack_values(matrix: sp.csc_array[np.float64], upper: FloatArray, iterate: FloatArray, slacks: int) -> FloatArray:
    """Return the smallest slacks (slacks,) with which the iterate satisfies all rows."""
    motion = np.concatenate([iterate, np.zeros(slacks)])
    over = np.maximum(matrix @ motion - upper, 0.0)
    column = matrix[:, iterate.size :].tocoo()
    lifts = column.data < 0.0
    values = np.zeros(slacks)
    np.maximum.at(values, column.col[lifts], over[column.row[lifts]])
    return values
