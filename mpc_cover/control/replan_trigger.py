"""When it is worth while for a fleet to rest and plan thoroughly, instead of flying on along what a step finds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray

_MOST, _IN_VAIN = 0.5, 3
"""Plans that leave more than this part of what is owed are thought over, so many times, each twice as long."""
_LONG_S = 16.0
"""More often than that, until thinking took so long [s]: a short planning time must not strand a fleet."""
_SAME_PLACE = 1e-3
"""Who moves less than this stays where it is [m]."""


class ReplanTrigger:
    """Keeps a fleet from flying poor plans, and from thinking for ever.

    Parameters
    ----------
    planning_s : how long the first thought takes.

    Attributes
    ----------
    wanted : whether the fleet should rest for a thorough plan.
    """

    def __init__(self, planning_s: float) -> None:
        self.wanted = False
        self._most = max(_IN_VAIN, int(np.ceil(np.log2(_LONG_S / planning_s))))
        self._in_vain = 0
        self._place: FloatArray | None = None
        self._owed = np.inf

    @property
    def patience(self) -> float:
        """How many times as long as usual the next planning may take: it doubles whenever that was too short."""
        return 2.0**self._in_vain

    def begin(self) -> None:
        """Start to plan thoroughly."""
        self.wanted = False

    def end(self) -> None:
        """Note what came of it: whether it is to be done again."""
        self._in_vain = self._in_vain + 1 if self.wanted else 0

    def is_poor(self, left: FloatArray, owed: FloatArray) -> bool:
        """Return whether a plan that leaves weights (J, K) of those owed is to be thought over once more."""
        return self._in_vain < self._most and bool(np.count_nonzero(left) > _MOST * np.count_nonzero(owed))

    def strand(self, here: FloatArray, owed: float) -> None:
        """Note a fleet at rest at (m, d) [m] that found no way on; at one place again only if less is owed by then."""
        if self._place is None or owed < self._owed or not stays_at(self._place, here):
            self.wanted = True
            self._place, self._owed = here, owed


def stays_at(position: FloatArray, here: FloatArray) -> bool:
    """Return whether positions (..., m, d) [m] never leave `here` (m, d)."""
    return bool((np.abs(position - here) < _SAME_PLACE).all())
