"""The allocation of demand: of all that the map owes, what one mission plan is to bring."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.coverage.nearest import remaining_weight
from mpc_cover.model.sensing import look_counts
from mpc_cover.planning.task import LOOKS_PER_LAP, needs_laps

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.information.demand import FlownMap
    from mpc_cover.mission.field import Field
    from mpc_cover.model.fleet_state import FleetState

_BY_LAP = 2
"""Looks at a cell that one mission plan is to bring if others must follow anyhow: a pass brings about two."""


class DemandAllocation:
    """Hands out the work to mission plans, one after another.

    Parameters
    ----------
    field : the cells, and how much they matter.
    """

    def __init__(self, field: Field) -> None:
        self._field = field
        self._later: IntArray | None = None

    @property
    def more(self) -> bool:
        """Whether looks are owed that the present mission plan was not asked for."""
        return self._later is not None and bool(self._later.any())

    def next(
        self, coverage: FlownMap, state: FleetState, *, single_pass: bool = False
    ) -> tuple[FloatArray, IntArray | None]:
        """Return weights and looks (J, K) that a new mission plan from here is to bring; looks None for one each.

        `single_pass` asks for all that are owed, however many, and begins no lap.
        """
        if not single_pass:
            coverage.begin_lap(state.time, state.position)
        owed = coverage.demand(state.time, state.position)
        weight = owed.gamma * self._field.weight
        if owed.looks is None or single_pass:
            self._later = None
            return weight, owed.looks
        most = _BY_LAP if needs_laps(owed.looks) else LOOKS_PER_LAP
        self._later = np.maximum(owed.looks - most, 0)
        return weight, np.minimum(owed.looks, most)

    def left(
        self, coverage: FlownMap, state: FleetState, later: FloatArray, radius: FloatArray
    ) -> tuple[FloatArray, IntArray | None]:
        """Return weights and looks (J, K) that the present mission plan is to bring beside what `later` brings.

        `later` is positions (n, m, d) [m] of its samples, `radius` (m, J) [m] of the fleet.
        """
        owed = coverage.demand(state.time, state.position)
        weight = owed.gamma * self._field.weight
        if owed.looks is None:
            return remaining_weight(later, self._field.cell, radius, weight), None
        beyond = 0 if self._later is None else self._later
        looks = np.maximum(owed.looks - beyond - look_counts(later, self._field.cell, radius), 0)
        return np.where(looks > 0, weight, 0.0), looks
