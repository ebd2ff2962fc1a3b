"""Disc sensing on cells (thesis 3.23, 4.29)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray

_TIE = 1e-9
"""A cell at distance exactly rho is measured, whatever the last bit says [m]."""


def measured(position: FloatArray, cell: FloatArray, radius: FloatArray) -> BoolArray:
    """Return (J, K): which magnitude is measured on which cell by a fleet at (m, d) positions [m].

    `cell` is (K, d) [m]; `radius` (m, J) [m], -inf where an agent cannot measure a magnitude (4.29).
    """
    distance = np.linalg.norm(position[:, None, :] - cell[None], axis=2)
    return np.asarray((distance[:, None, :] <= radius[:, :, None] + _TIE).any(axis=0))


def covered_at(time: FloatArray, position: FloatArray, cell: FloatArray, radius: FloatArray) -> FloatArray:
    """Return (K,) [s]: the first of the (T,) sample times by which every magnitude was measured; inf where never.

    `position` is (T, m, d) [m].
    """
    first = np.full((radius.shape[1], cell.shape[0]), np.inf)
    for t, now in zip(time, position, strict=True):
        first = np.where(measured(now, cell, radius), np.minimum(first, t), first)
    return np.asarray(first.max(axis=0))
