"""How an agent leaves a stationary point: a common displacement of the fleet, and a detour around silent agents.

Pulled to both sides at bounded speed, a connected fleet may hang for long where small random steps do not resolve the
tie (5.17). Lemma 6.2.1 leaves the point by a common displacement. When an agent's own map has not changed for a while,
it attends to one cell only: the owed one that comes first in a random order that the fleet shares. While nothing is
measured, the agents' maps become equal within the delay, so all attend to the same cell without a message about it;
going there changes no distance between them that matters, and the nearest of them measures it.

An obstacle at rest does not move with the fleet. So an agent that is stalled and drawn towards a silent one nearby goes
around it, in turns to the left and to the right, because there may be no room on one side.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray

_PLANE = 2


class StallEscape:
    """Notices when one agent stalls, and chooses the cell that it then attends to.

    Parameters
    ----------
    order : (K,) a random permutation, the same for the whole fleet.
    patience : samples without a change for the better after which one cell counts only; longer than the delay.
    """

    def __init__(self, order: IntArray, patience: float) -> None:
        self._order = order
        self._patience = patience
        self._before: FloatArray | None = None
        self._waited = 0

    @property
    def stalled(self) -> bool:
        """Whether the last map had not changed for the better for too long."""
        return self._waited >= self._patience

    def attend(self, weight: FloatArray) -> FloatArray:
        """Return the (K,) gamma to go by, from this sample's (K,) gamma of the agent's own map."""
        better = self._before is None or bool((weight < self._before).any())
        self._before = weight
        self._waited = 0 if better else self._waited + 1
        if not self.stalled:
            return weight
        owed = self._order[weight[self._order] > 0.0]
        only = np.zeros_like(weight)
        only[owed[:1]] = weight[owed[:1]]
        return only


def detour(desired: FloatArray, position: FloatArray, centre: FloatArray, near: FloatArray, turn: float) -> FloatArray:
    """Return the velocity (d,) [m/s] that goes around the nearest obstacle instead of at it.

    Parameters
    ----------
    desired : (d,) [m/s].
    position : (d,) [m].
    centre, near : (n, d) [m] obstacles, and within which distance (n,) [m] of its centre each is gone around.
    turn : +1 leaves it on the right, -1 on the left.
    """
    if len(centre) == 0:
        return desired
    offset = centre - position
    away = np.linalg.norm(offset, axis=1)
    nearest = int(np.argmin(away - near))
    ahead = offset[nearest] / max(float(away[nearest]), 1e-9)
    if away[nearest] > near[nearest] or float(desired @ ahead) <= 0.0:
        return desired
    return turn * float(np.linalg.norm(desired)) * _sideways(ahead)


def _sideways(ahead: FloatArray) -> FloatArray:
    """Return a unit vector (d,) at right angles: to the left in the plane, horizontal in space where possible."""
    if ahead.size == _PLANE:
        return np.array([-ahead[1], ahead[0]])
    level = np.array([-ahead[1], ahead[0], 0.0])
    length = float(np.linalg.norm(level))
    return level / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])  # noqa: PLR2004 - straight up or down
