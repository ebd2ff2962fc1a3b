"""Ageing maps in flight: repeated laps over the cells that are due (chapter 7)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.information.ageing import AgeingMap
from mpc_cover.information.demand import Demand, checked, scaled

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.information.looks import Sensing


class PatrolMap:
    """The map of a patrol; satisfies `demand.FlownMap`, and is never complete.

    Places that were never measured are owed from the start, and as old as the mission. A lap is what a plan has to
    cover: places that will be too old when the lap is over, and were not measured since it began. The duration of
    laps is estimated from those completed.

    Parameters
    ----------
    sensing : which cells are in range.
    limit_s : how long a look is as good as new [s].
    growth_per_s : gamma's growth beyond that [1/s].
    """

    endless = True
    complete = False

    def __init__(self, sensing: Sensing, limit_s: float, growth_per_s: float = 1.0) -> None:
        self.ages = AgeingMap(sensing, limit_s)
        self.first: FloatArray = np.full(sensing.shape, np.inf)
        self._sensing, self.limit_s, self._growth = sensing, limit_s, growth_per_s
        self._lap: FloatArray = np.full(sensing.shape, 1.0)
        self._lap_from, self._lap_s = 0.0, 0.0

    def observe(self, time_s: float | FloatArray, position: FloatArray) -> None:
        """Take in what a fleet at (m, d) positions [m] measures at a mission time [s], one for all or (m,)."""
        looks = self._sensing.looks(time_s, position)
        np.minimum.at(self.first.reshape(-1), looks.place, looks.time_s)
        if self._lap.any():
            self._lap.reshape(-1)[looks.place] = 0.0
            if not self._lap.any():
                self._end_lap(float(looks.time_s.max()))
        self.ages.take(looks)
        times = np.asarray(time_s, dtype=float)
        self.ages.pass_time(float(times.max(initial=self.ages.now_s, where=np.isfinite(times))))

    @property
    def residual(self) -> FloatArray:
        """(J, K) gamma: by how much the age exceeds its limit, times its growth."""
        return self._growth * self.ages.residual

    def begin_lap(self, time_s: float, position: FloatArray) -> None:
        """Choose what a lap from (m, d) positions [m] at `time_s` [s] on covers, weighted by the excess of age.

        A lap begins as late as possible: when a place would be too old at its end, or is unknown. It includes all
        places that would be too old another lap later, for which the next lap would have to begin too early.
        """
        if self._lap.any() and not self.demand(time_s, position).gamma.any():
            self._end_lap(time_s)
        here = self._in_range(time_s, position)
        spare = np.where(here, self.limit_s, self.ages.last + self.limit_s - time_s)
        unknown = np.isinf(self.first) & ~here
        if not unknown.any() and float(spare.min()) >= self._lap_s:
            self._lap = np.zeros_like(spare)
            return
        self._lap_from = time_s
        excess = np.maximum(2.0 * self._lap_s - spare, 0.0)
        excess[unknown] = excess.max(initial=1.0, where=~unknown)
        self._lap = scaled(excess)

    def demand(self, time_s: float, position: FloatArray) -> Demand:
        """Return what is left of the lap, without what is in range of the fleet at (m, d) positions [m] then."""
        return Demand(np.where(self._in_range(time_s, position), 0.0, self._lap))

    def _in_range(self, time_s: float, position: FloatArray) -> BoolArray:
        seen = np.zeros(self.first.size, dtype=bool)
        seen[self._sensing.looks(time_s, position).place] = True
        return seen.reshape(self.first.shape)

    def _end_lap(self, time_s: float) -> None:
        self._lap_s = max(self._lap_s, time_s - self._lap_from)

    @property
    def owed(self) -> BoolArray:
        """(J, K): everywhere; each place will be owed another look."""
        return np.ones(self.first.shape, dtype=bool)

    @property
    def overdue(self) -> BoolArray:
        """(J, K): what is too old now, or unknown."""
        return self.ages.owed | np.isinf(self.first)

    @property
    def covered_at(self) -> FloatArray:
        """(K,) [s]: when the last magnitude was measured for the first time; inf where never."""
        return np.asarray(self.first.max(axis=0))

    @property
    def settled(self) -> BoolArray:
        """(K,): where nothing is too old now."""
        return np.asarray(~self.overdue.any(axis=0))

    @property
    def cell_count(self) -> int:
        """Number of cells K."""
        return int(self.first.shape[1])

    @property
    def covered_count(self) -> int:
        """Number of cells on which nothing is too old now."""
        return int(self.settled.sum())

    @property
    def fraction(self) -> float:
        """Part of the cells on which nothing is too old now."""
        return self.covered_count / self.cell_count

    def state(self) -> dict[str, FloatArray]:
        """Return the state from which a later controller resumes exactly."""
        kept = {"first": self.first, "last": self.ages.last, "lap": self._lap}
        clock = np.array([self.ages.now_s, self._lap_from, self._lap_s])
        return {name: array.copy() for name, array in kept.items()} | {"clock": clock}

    def restore(self, state: Mapping[str, FloatArray]) -> None:
        """Resume from what `state` returned; raise ValueError if it is that of another map."""
        shape = self.first.shape
        found = checked(state, {"first": shape, "last": shape, "lap": shape, "clock": (3,)})
        self.first, self.ages.last, self._lap = found["first"], found["last"], found["lap"]
        self.ages.now_s, self._lap_from, self._lap_s = found["clock"].tolist()
