"""Which cells the remaining agents can still measure, after losses and around the obstacles that these leave."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.facets import inscribed

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.model.fleet_constraints import FleetConstraints

_RINGS = (0.0, 0.25, 0.5, 0.75, 0.98)
"""Distances from a cell, in sensing radii, of the positions that are tried to measure it from; a plain choice."""
_SIDES = 32
"""Directions that are tried at each distance in the plane; a plain choice."""


def reachable(fleet: FleetConstraints, cell: FloatArray, obstacles: FloatArray) -> BoolArray:
    """Return (J, K): whether an active agent can measure each magnitude on each cell, (K, d) [m].

    It needs a position inside the box, clear of the (L, d) [m] `obstacles`. Positions are sampled on rings around the
    cell: True is certain; False may be wrong where only a sliver of positions is free.
    """
    normal = inscribed(fleet.dimension, _SIDES).normal
    direction = np.concatenate([normal, -normal])
    able = np.zeros((fleet.radius.shape[1], cell.shape[0]), dtype=bool)
    for radius in np.unique(fleet.radius[list(fleet.active)]):
        if not np.isfinite(radius) or radius <= 0.0:
            continue
        measurable = np.zeros(cell.shape[0], dtype=bool)
        for ring in _RINGS:
            position = cell[:, None] + ring * radius * direction
            clear = ((position >= fleet.motion_min) & (position <= fleet.motion_max)).all(axis=2)
            for obstacle in obstacles:
                clear &= np.linalg.norm(position - obstacle, axis=2) >= fleet.separation_min
            measurable |= clear.any(axis=1)
        for magnitude in np.flatnonzero((fleet.radius[list(fleet.active)] >= radius).any(axis=0)):
            able[magnitude] |= measurable
    return able
