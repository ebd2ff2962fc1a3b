"""Ageing maps for fields that change in time: gamma grows again outside the sensing range (chapter 7)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.information.looks import Looks, Sensing


class AgeingMap:
    """gamma = pos(age - fresh_s): a measurement is valid for a while, then the cell is owed a look again.

    It is never complete for good: a mission with it patrols without end.

    Parameters
    ----------
    sensing : which cells are in range.
    fresh_s : how long a measurement is as good as new [s].
    start_s : mission time at which everything counts as just measured [s].

    Attributes
    ----------
    last : (J, K) [s], when each magnitude and cell was last measured.
    now_s : the latest time of an observation [s].

    Raises
    ------
    ValueError
        `fresh_s` is negative or not finite.
    """

    def __init__(self, sensing: Sensing, fresh_s: float, start_s: float = 0.0) -> None:
        if not 0.0 <= fresh_s < np.inf:
            raise ValueError(f"ageing map: fresh_s {fresh_s}: must be at least 0 and finite")
        self._sensing = sensing
        self._fresh = fresh_s
        self.last: FloatArray = np.full(sensing.shape, start_s)
        self.now_s = start_s

    def observe(self, time_s: float, position: FloatArray) -> None:
        """Take in what a fleet at (m, d) positions [m] measures at a mission time [s]; NaN rows measure nothing."""
        self.take(self._sensing.looks(time_s, position))
        self.pass_time(time_s)

    def take(self, looks: Looks) -> None:
        """Take in looks, in any order."""
        np.maximum.at(self.last.reshape(-1), looks.place, looks.time_s)
        self.pass_time(float(looks.time_s.max(initial=self.now_s)))

    def pass_time(self, time_s: float) -> None:
        """Let everything age until a mission time [s]; earlier times are ignored."""
        self.now_s = max(self.now_s, time_s)

    @property
    def age(self) -> FloatArray:
        """(J, K) [s] since the last look."""
        return np.asarray(self.now_s - self.last)

    @property
    def worst_age(self) -> float:
        """Largest age [s]."""
        return float(self.age.max())

    @property
    def mean_age(self) -> float:
        """Mean age [s]."""
        return float(self.age.mean())

    @property
    def residual(self) -> FloatArray:
        """(J, K) gamma [s]: by how much the age exceeds what is fresh."""
        return np.asarray(np.maximum(self.age - self._fresh, 0.0))

    @property
    def owed(self) -> BoolArray:
        """(J, K): where gamma > 0."""
        return self.residual > 0.0

    @property
    def fraction(self) -> float:
        """Part of the cells that are fresh now."""
        return float((~self.owed).all(axis=0).mean())

    @property
    def complete(self) -> bool:
        """Whether everything is fresh now."""
        return not bool(self.owed.any())
