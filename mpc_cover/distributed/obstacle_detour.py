"""The way around an obstacle that will not move: an agent that is silent.

Lemma 6.2.1 leaves stationary points by moving the fleet as one, which an obstacle at rest does not do. So an agent
that gets nowhere, and is drawn towards one that is silent and near, goes around it; in turns to the left and to the
right, because there may be no room on one side.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray

_PLANE = 2


def detour(wish: FloatArray, position: FloatArray, centre: FloatArray, near: FloatArray, turn: float) -> FloatArray:
    """Return the velocity (d,) [m/s] that goes around the nearest obstacle instead of at it.

    Parameters
    ----------
    wish : (d,) [m/s].
    position : (d,) [m].
    centre, near : (n, d) [m] obstacles, and within which distance (n,) [m] of its centre each is gone around.
    turn : +1 leaves it on the right, -1 on the left.
    """
    if len(centre) == 0:
        return wish
    offset = centre - position
    away = np.linalg.norm(offset, axis=1)
    nearest = int(np.argmin(away - near))
    ahead = offset[nearest] / max(float(away[nearest]), 1e-9)
    if away[nearest] > near[nearest] or float(wish @ ahead) <= 0.0:
        return wish
    return turn * float(np.linalg.norm(wish)) * _sideways(ahead)


def _sideways(ahead: FloatArray) -> FloatArray:
    """Return a unit vector (d,) at right angles: in the plane to the left, in space level where there is a level."""
    if ahead.size == _PLANE:
        return np.array([-ahead[1], ahead[0]])
    level = np.array([-ahead[1], ahead[0], 0.0])
    length = float(np.linalg.norm(level))
    return level / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])  # noqa: PLR2004 - straight up or down
