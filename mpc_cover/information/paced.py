"""Sensing whose looks count at most once a period: an agent's next look at a cell counts a period after its last.

Agents report several times a period; without this, the number of looks would depend on how often they report.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.information.looks import Looks, Sensing

_EARLY = 1e-6
"""Part of a period that a look may come too soon: instants are sums of periods, and rounded."""


class PacedSensing:
    """The looks of another sensing that count.

    Taking each look as soon as it counts is optimal: no choice of instants a period apart has more by any time. So
    plans, which look at their samples only, promise no more looks than are counted.

    Parameters
    ----------
    sensing : which cells are in range.
    agents : number of agents m.
    period_s : T_s [s].
    """

    def __init__(self, sensing: Sensing, agents: int, period_s: float) -> None:
        self._sensing = sensing
        self._wait = period_s * (1.0 - _EARLY)
        rows, columns = sensing.shape
        # zeros cost no memory where there are no looks; missions begin at 0 s
        self._free_at: FloatArray = np.zeros((agents, rows * columns))
        self._now_s = 0.0

    @property
    def shape(self) -> tuple[int, int]:
        """(J, K): magnitudes and cells."""
        return self._sensing.shape

    def looks(self, time_s: float | FloatArray, position: FloatArray, agent: IntArray | None = None) -> Looks:
        """Return the looks of agents (m,) at (m, d) positions [m] that count, and record them."""
        seen = self._sensing.looks(time_s, position, agent)
        counted = seen.where(seen.time_s >= self._free_at[seen.agent, seen.place])
        self._free_at[counted.agent, counted.place] = counted.time_s + self._wait
        self._now_s = max(self._now_s, float(counted.time_s.max(initial=0.0)))
        return counted

    def too_soon(self, time_s: float, position: FloatArray) -> IntArray:
        """Return (J, K): how many agents at (m, d) positions [m] are in range, but would look again too soon."""
        seen = self._sensing.looks(time_s, position)
        early = seen.where(seen.time_s < self._free_at[seen.agent, seen.place])
        rows, columns = self.shape
        return np.bincount(early.place, minlength=rows * columns).reshape(rows, columns)

    def state(self) -> FloatArray:
        """Return (3, n): agent, place, and when its next look there counts [s], where that is in the future."""
        agent, place = np.nonzero(self._free_at > self._now_s)
        return np.stack([agent.astype(float), place.astype(float), self._free_at[agent, place]])

    def restore(self, state: FloatArray) -> None:
        """Resume from what `state` returned."""
        self._free_at = np.zeros_like(self._free_at)
        self._free_at[state[0].astype(np.intp), state[1].astype(np.intp)] = state[2]
        self._now_s = float((state[2] - self._wait).max(initial=0.0))
