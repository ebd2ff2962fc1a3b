"""Demand allocation: the part of the map's outstanding looks that one mission plan has to take."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.coverage.nearest import remaining_weight
from mpc_cover.model.sensing import look_counts
from mpc_cover.planning.task import LOOKS_PER_LAP, needs_laps

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.information.demand import DemandMap
    from mpc_cover.mission.field import Field
    from mpc_cover.model.fleet_state import FleetState

_LOOKS_PER_PASS = 2
"""Looks at a cell that one mission plan has to take if more plans must follow: about as many as a pass takes."""


class DemandAllocation:
    """Allocates demand to successive mission plans.

    Parameters
    ----------
    field : cells and their weights.
    """

    def __init__(self, field: Field) -> None:
        self._field = field
        self._deferred: IntArray | None = None

    @property
    def more(self) -> bool:
        """Whether looks are outstanding that were not allocated to the present mission plan."""
        return self._deferred is not None and bool(self._deferred.any())

    def next(
        self, coverage: DemandMap, state: FleetState, *, single_pass: bool = False
    ) -> tuple[FloatArray, IntArray | None]:
        """Return weights and looks (J, K) for a new mission plan from this state; looks None for one each.

        `single_pass` allocates all outstanding looks, however many, and begins no lap.
        """
        if not single_pass:
            coverage.begin_lap(state.time, state.position)
        demand = coverage.demand(state.time, state.position)
        weight = demand.gamma * self._field.weight
        if demand.looks is None or single_pass:
            self._deferred = None
            return weight, demand.looks
        most = _LOOKS_PER_PASS if needs_laps(demand.looks) else LOOKS_PER_LAP
        self._deferred = np.maximum(demand.looks - most, 0)
        return weight, np.minimum(demand.looks, most)

    def left(
        self, coverage: DemandMap, state: FleetState, later: FloatArray, radius: FloatArray
    ) -> tuple[FloatArray, IntArray | None]:
        """Return weights and looks (J, K) allocated to the present mission plan that `later` samples do not take.

        `later` is positions (n, m, d) [m] of its samples, `radius` (m, J) [m] of the fleet.
        """
        demand = coverage.demand(state.time, state.position)
        weight = demand.gamma * self._field.weight
        if demand.looks is None:
            return remaining_weight(later, self._field.cell, radius, weight), None
        deferred = 0 if self._deferred is None else self._deferred
        looks = np.maximum(demand.looks - deferred - look_counts(later, self._field.cell, radius), 0)
        return np.where(looks > 0, weight, 0.0), looks
