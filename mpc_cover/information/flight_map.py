"""Maps of several looks in flight: K-coverage, effective coverage and Kalman maps, updated once a period."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.information.demand import Demand, checked, scaled

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.information.looks import Sensing
    from mpc_cover.information.paced import PacedSensing
    from mpc_cover.information.residual_map import ResidualMap


class FlightMap:
    """A residual map whose looks count once a period; satisfies `demand.FlownMap`.

    Parameters
    ----------
    inner : the map that looks are fused into.
    pace : selects the looks that count; `sensing` is the same, with readings where the map asks for them.
    graded : whether gamma weights plans; where each look adds the same, the number of looks owed suffices.
    """

    endless = False

    def __init__(self, inner: ResidualMap, pace: PacedSensing, sensing: Sensing, *, graded: bool) -> None:
        self.map = inner
        self._pace, self._sensing, self._graded = pace, sensing, graded

    def observe(self, time_s: float | FloatArray, position: FloatArray) -> None:
        """Take in what a fleet at (m, d) positions [m] measures at a mission time [s], one for all or (m,)."""
        self.map.take(self._sensing.looks(time_s, position))

    def demand(self, time_s: float, position: FloatArray) -> Demand:
        """Return what a plan from (m, d) positions [m] at `time_s` [s] on is to cover.

        Plans count a look at their first sample; where that comes too soon to count, one more is asked for.
        """
        owed = self.map.owed
        gamma = scaled(self.map.residual) if self._graded else owed.astype(float)
        looks = np.where(owed, self.map.looks_expected + self._pace.too_soon(time_s, position), 0)
        return Demand(gamma, looks if looks.max(initial=0) > 1 else None)

    def begin_lap(self, time_s: float, position: FloatArray) -> None:
        """Do nothing: this map has no laps."""

    @property
    def residual(self) -> FloatArray:
        """(J, K) gamma >= 0."""
        return self.map.residual

    @property
    def owed(self) -> BoolArray:
        """(J, K): where something is owed."""
        return self.map.owed

    @property
    def covered_at(self) -> FloatArray:
        """(K,) [s]: when nothing was owed any more; inf where something still is."""
        return self.map.covered_at

    @property
    def settled(self) -> BoolArray:
        """(K,): where nothing is owed."""
        return np.asarray(~self.map.owed.any(axis=0))

    @property
    def cell_count(self) -> int:
        """Number of cells K."""
        return int(self.map.owed.shape[1])

    @property
    def covered_count(self) -> int:
        """Number of cells on which nothing is owed."""
        return self.map.covered_count

    @property
    def fraction(self) -> float:
        """Part of the cells on which nothing is owed, 0 to 1; exactly 1 only when complete."""
        return self.map.fraction

    @property
    def complete(self) -> bool:
        """Whether nothing is owed."""
        return self.map.complete

    def state(self) -> dict[str, FloatArray]:
        """Return the state from which a later controller resumes exactly."""
        return {name: array.copy() for name, array in self.map.kept.items()} | {"recent": self._pace.state()}

    def restore(self, state: Mapping[str, FloatArray]) -> None:
        """Resume from what `state` returned; raise ValueError if it is that of another map."""
        shapes = {name: array.shape for name, array in self.map.kept.items()}
        found = checked(state, {**shapes, "recent": (3, None)})
        for name, array in self.map.kept.items():
            array[:] = found[name]
        self._pace.restore(found["recent"])
