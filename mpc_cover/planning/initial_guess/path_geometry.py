"""Geometry of paths of waypoints: lengths along them, points at such lengths, and distances to their legs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.tolerances import DIVISOR_MIN

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray


def path_length(path: FloatArray) -> float:
    """Return the length [m] of a path (W, d) [m]."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def lengths_along(path: FloatArray) -> FloatArray:
    """Return the lengths (W,) [m] along a path (W, d) [m] at which its waypoints lie."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])


def points_along(path: FloatArray, length: FloatArray) -> FloatArray:
    """Return the points (P, d) [m] at lengths (P,) [m] along a path (W, d) [m]; beyond its ends, the ends."""
    at = lengths_along(path)
    return np.stack([np.interp(length, at, path[:, axis]) for axis in range(path.shape[1])], axis=1)


def leg_distance(cell: FloatArray, begin: FloatArray, end: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return distances (K,) [m] of (K, d) cells [m] to the leg between two points, and the part of it passed there."""
    leg = end - begin
    part = np.clip((cell - begin) @ leg / max(float(leg @ leg), DIVISOR_MIN), 0.0, 1.0)
    return np.linalg.norm(cell - begin - part[:, None] * leg, axis=1), part
