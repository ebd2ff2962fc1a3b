"""The map of plain coverage: one look for each cell and magnitude (thesis 5.2.1 with K = 1)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.information.demand import Demand, checked
from mpc_cover.information.passes import Passes
from mpc_cover.information.visibility import Visibility
from mpc_cover.mission.config import Sensing

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.mission.load import Mission


class CoverageMap:
    """Marks cells as covered from measured positions, never from planned ones.

    Satisfies `demand.FlownMap`. `first` is (J, K) [s]: when each magnitude was first measured on each cell, inf where
    never. Sensing radii are shortened by `margin_m` [m], by default the noise of the mission's positions, so that
    cells that are marked were truly measured.
    """

    endless = False

    def __init__(self, mission: Mission, margin_m: float | None = None) -> None:
        self._cell = mission.field.cell
        noise_m = mission.spec.disturbance.position_noise_m if margin_m is None else margin_m
        radius = mission.fleet.radius - noise_m if noise_m else mission.fleet.radius
        self._visibility = Visibility(mission.field, radius)
        self.first: FloatArray = np.full(self._visibility.shape, np.inf)
        self._passes = Passes(mission, radius) if mission.spec.sensing is Sensing.CONTINUOUS else None

    def observe(self, time_s: float | FloatArray, position: FloatArray) -> None:
        """Mark what a fleet at (m, d) positions [m] measures at a mission time [s]; NaN rows measure nothing.

        Of agents that measure at different times (m,) the latest counts. Continuous sensors measured on the way, too.
        """
        first, seen = self.first.reshape(-1), self._visibility.looks(0.0, position).place
        first[seen] = np.minimum(first[seen], np.max(time_s))
        if self._passes is not None:
            for magnitude, cells, when_s in self._passes.advance(time_s, position, self.owed):
                self.first[magnitude, cells] = np.minimum(self.first[magnitude, cells], when_s)

    def demand(self, time_s: float, position: FloatArray) -> Demand:  # noqa: ARG002 - as all maps
        """Return what a plan has to cover: everything owed."""
        return Demand(self.residual)

    def begin_lap(self, time_s: float, position: FloatArray) -> None:
        """Do nothing: this map has no laps."""

    @property
    def residual(self) -> FloatArray:
        """(J, K) gamma: 1 where owed, else 0."""
        return self.owed.astype(float)

    @property
    def owed(self) -> BoolArray:
        """(J, K): what has not been measured yet; gamma of (4.34) as 0 or 1."""
        return np.isinf(self.first)

    @property
    def covered_at(self) -> FloatArray:
        """(K,) [s]: when the last magnitude was measured on each cell; inf where never."""
        return np.asarray(self.first.max(axis=0))

    @property
    def settled(self) -> BoolArray:
        """(K,): where everything was measured."""
        return np.isfinite(self.covered_at)

    @property
    def cell_count(self) -> int:
        """Number of cells K."""
        return int(self._cell.shape[0])

    @property
    def covered_count(self) -> int:
        """Number of cells on which everything was measured."""
        return int(self.settled.sum())

    @property
    def fraction(self) -> float:
        """Covered part of the cells, 0 to 1; exactly 1 only when nothing is owed."""
        return self.covered_count / int(self._cell.shape[0])

    @property
    def complete(self) -> bool:
        """Whether nothing is owed."""
        return not bool(self.owed.any())

    def state(self) -> dict[str, FloatArray]:
        """Return the state from which a later controller resumes."""
        return {"first": self.first.copy()}

    def restore(self, state: Mapping[str, FloatArray]) -> None:
        """Resume from what `state` returned; raise ValueError if it is that of another map."""
        self.first = checked(state, {"first": self.first.shape})["first"]
