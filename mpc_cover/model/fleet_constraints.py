"""What plans of a fleet are held to: its specification, tightened, relaxed, and without those who are lost."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.arrays import read_only
from mpc_cover.mission.fleet import Fleet

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mpc_cover.arrays import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class FleetConstraints(Fleet):
    """The bounds of m agents, some of whom may take no part.

    What follows from the fields is worked out once, and its arrays are read-only.

    Attributes
    ----------
    lost : agents that take no part any more: they stand still, and the others keep clear of them.
    pair_separation : {(i, j): what is asked of a pair [m], i < j} where that is not rho_B: two who are too near already
        cannot help it, but everyone else can.
    reaction_periods : periods that pass until the others know that someone has stopped; plans leave room for that. 0
        when nobody is expected to.
    """

    lost: tuple[int, ...] = ()
    pair_separation: Mapping[tuple[int, int], float] = field(default_factory=dict)
    reaction_periods: float = 0.0

    @classmethod
    def of(cls, fleet: Fleet, **changes: Any) -> FleetConstraints:
        """Return the constraints that a specification states, with some fields changed."""
        if isinstance(fleet, FleetConstraints) and not changes:
            return fleet
        known = fields(cls) if isinstance(fleet, FleetConstraints) else fields(Fleet)
        return cls(**{**{each.name: getattr(fleet, each.name) for each in known}, **changes})

    @cached_property
    def separations(self) -> FloatArray:
        """(pairs,) the least distance [m] of each pair i < j, row by row; nothing is asked of two who are lost."""
        every, lost, own = combinations(range(self.size), 2), set(self.lost), self.pair_separation
        asked = [0.0 if lost.issuperset(pair) else own.get(pair, self.separation_min) for pair in every]
        return read_only(np.array(asked))

    @cached_property
    def active(self) -> tuple[int, ...]:
        """The agents that take part."""
        return tuple(i for i in range(self.size) if i not in self.lost)

    @cached_property
    def is_active(self) -> BoolArray:
        """(m,) whether an agent takes part."""
        return read_only(np.array([i not in self.lost for i in range(self.size)]))
