"""Bounds on single variables: motion box (4.15, 4.16), trust region, and boundary conditions (4.17)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.rows import Layout, Rows

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class BoundaryConditions:
    """Initial and terminal states, (m, d) [m], [m/s] each; None where they are free.

    `closed` requires z(N) = z(0), as repeated surveillance does (3.15).
    """

    start_position: FloatArray | None = None
    start_velocity: FloatArray | None = None
    end_position: FloatArray | None = None
    end_velocity: FloatArray | None = None
    closed: bool = False


def bound_rows(
    layout: Layout,
    position: FloatArray,
    box: tuple[FloatArray, FloatArray],
    trust: float,
    ends: BoundaryConditions,
    still: tuple[int, ...] = (),
) -> list[Rows]:
    """Return bounds on all positions, and the equalities of the boundary conditions.

    `position` is the iterate (N+1, m, d) [m], `trust` the trust-region radius [m], `box` the corners (m, d) [m]. An
    iterate outside the box may stay where it is, but may not move farther out. Agents in `still` do not move.
    """
    lower = np.maximum(position - trust, np.minimum(box[0], position))
    upper = np.minimum(position + trust, np.maximum(box[1], position))
    stage = layout.agents * layout.dimension
    if still:
        lower[:, still] = upper[:, still] = position[:1, still]
    if ends.start_position is not None:
        lower[0] = upper[0] = ends.start_position
    if ends.end_position is not None:
        lower[-1] = upper[-1] = ends.end_position
    blocks = [_fixed(np.arange(layout.half), lower.ravel(), upper.ravel())]
    for first, velocity in ((layout.half, ends.start_velocity), (layout.size - stage, ends.end_velocity)):
        if velocity is not None:
            blocks.append(_fixed(first + np.arange(stage), velocity.ravel(), velocity.ravel()))
    if ends.closed:
        blocks.append(_closed(layout))
    return blocks


def _fixed(column: np.ndarray, lower: FloatArray, upper: FloatArray) -> Rows:
    return Rows(np.arange(column.size), column, np.ones(column.size), lower, upper.copy())


def _closed(layout: Layout) -> Rows:
    """Return z(N) - z(0) = 0."""
    stage = layout.agents * layout.dimension
    each = np.arange(stage)
    begin = np.concatenate([each, layout.half + each])
    end = begin + layout.half - stage
    zero = np.zeros(2 * stage)
    one = np.ones(2 * stage)
    row = np.tile(np.arange(2 * stage), 2)
    return Rows(row, np.concatenate([end, begin]), np.concatenate([one, -one]), zero, zero.copy())
