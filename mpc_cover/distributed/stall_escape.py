"""How a fleet leaves a tug-of-war that small random steps do not resolve (5.17, lemma 6.2.1).

Pulled to both sides at bounded speed, a connected fleet may hang for long. The lemma's way out is a common
displacement. When an agent's own map has not changed for a while, it attends to one cell only: the owed one
that comes first in a random order that the fleet shares. While nothing is measured, the agents' maps become
equal within the delay, so all attend to the same cell, without a message about it; going there changes no
distance between them that matters, and the nearest of them measures it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray


class StallEscape:
    """One agent's patience.

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
