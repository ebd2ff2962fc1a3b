"""Cells of shapes of which most of the bounding box is empty."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from motions import grid

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray


def ring() -> FloatArray:
    """Return a square ring 10 m wide, whose sides are 2 m wide."""
    cell = grid(20, 0.5)
    return cell[(np.abs(cell - 5.0) > 3.0).any(axis=1)]


def diagonal() -> FloatArray:
    """Return a path 1.5 m wide along the diagonal of a square of 12 m."""
    cell = grid(24, 0.5)
    return cell[np.abs(cell[:, 0] - cell[:, 1]) <= 1.1]


def lanes() -> FloatArray:
    """Return three lanes of 12 m x 1.5 m, 3.5 m apart."""
    cell = grid(24, 0.5)
    return cell[(cell[:, 1] % 5.0) < 1.5]


def dumbbell() -> FloatArray:
    """Return two squares of 4 m and a corridor 1 m wide and 8 m long between them."""
    cell = grid(32, 0.5)
    ends = (np.abs(cell[:, 0] - 8.0) > 4.0) & (cell[:, 1] < 4.0)
    return cell[ends | (np.abs(cell[:, 1] - 2.0) < 0.5)]


def islands() -> FloatArray:
    """Return three islands of 2 m, 3 m and 4 m on a square of 15 m."""
    cell = grid(30, 0.5)
    corner = np.array([[0.0, 0.0], [12.0, 1.0], [5.0, 11.0]])
    inside = (cell[:, None] > corner) & (cell[:, None] < corner + np.array([[2.0], [3.0], [4.0]]))
    return cell[inside.all(axis=2).any(axis=1)]


def tube() -> FloatArray:
    """Return a bent tube in space."""
    cell = grid(16, 0.5, 3)
    return cell[((cell[:, 0] < 1.0) | (cell[:, 1] < 1.0)) & (np.abs(cell[:, 2] - 4.0) < 0.6)]


SHAPES = {made.__name__: made for made in (ring, diagonal, lanes, dumbbell, islands, tube)}
"""The shapes by name."""
