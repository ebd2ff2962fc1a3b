"""Constraints of a fleet's plans: the specification, tightened, relaxed where unattainable, without lost agents."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.arrays import read_only
from mpc_cover.mission.fleet import Fleet
from mpc_cover.model.look_instants import AT_SAMPLES, LookInstants

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mpc_cover.arrays import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class FleetConstraints(Fleet):
    """The bounds of m agents, some of which may be lost.

    Derived quantities are computed once, and their arrays are read-only.

    Attributes
    ----------
    lost : indices of lost agents: static obstacles that the others keep clear of.
    pair_separation : {(i, j): required distance [m], i < j} of pairs that cannot keep rho_B because they are nearer
        already; all other pairs keep rho_B.
    reaction_periods : periods until the others react to an agent that stops without warning, for which plans leave
        room (passive safety); 0 to leave none.
    look_instants : when sensors look, within each step of a plan.
    """

    lost: tuple[int, ...] = ()
    pair_separation: Mapping[tuple[int, int], float] = field(default_factory=dict)
    reaction_periods: float = 0.0
    look_instants: LookInstants = AT_SAMPLES

    @classmethod
    def of(cls, fleet: Fleet, **changes: Any) -> FleetConstraints:
        """Return the constraints of a specification, with some fields changed."""
        if isinstance(fleet, FleetConstraints) and not changes:
            return fleet
        known = fields(cls) if isinstance(fleet, FleetConstraints) else fields(Fleet)
        return cls(**{**{each.name: getattr(fleet, each.name) for each in known}, **changes})

    @cached_property
    def separations(self) -> FloatArray:
        """(pairs,) required distance [m] of each pair i < j, row by row; 0 for two lost agents."""
        every, lost, own = combinations(range(self.size), 2), set(self.lost), self.pair_separation
        asked = [0.0 if lost.issuperset(pair) else own.get(pair, self.separation_min) for pair in every]
        return read_only(np.array(asked))

    @cached_property
    def active(self) -> tuple[int, ...]:
        """Indices of the agents that are not lost."""
        return tuple(i for i in range(self.size) if i not in self.lost)

    @cached_property
    def is_active(self) -> BoolArray:
        """(m,) whether an agent is not lost."""
        return read_only(np.array([i not in self.lost for i in range(self.size)]))
