"""What those who are left can still measure: some things only the lost could, some places they block."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.facets import inscribed

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.model.fleet_constraints import FleetConstraints

_RINGS = (0.0, 0.25, 0.5, 0.75, 0.98)
"""Distances from a cell, in sensing radii, at which a place to measure it from is looked for."""
_SIDES = 32


def reachable(fleet: FleetConstraints, cell: FloatArray, obstacles: FloatArray) -> BoolArray:
    """Return (J, K): whether someone left can measure each magnitude on each cell, (K, d) [m].

    From a place inside the box, clear of the (L, d) [m] `obstacles`. Places are tried in rings around the cell: what is
    found can be measured; what is not, but for a sliver, cannot.
    """
    normal = inscribed(fleet.dimension, _SIDES).normal
    direction = np.concatenate([normal, -normal])
    able = np.zeros((fleet.radius.shape[1], cell.shape[0]), dtype=bool)
    for radius in np.unique(fleet.radius[list(fleet.active)]):
        if not np.isfinite(radius) or radius <= 0.0:
            continue
        seen = np.zeros(cell.shape[0], dtype=bool)
        for ring in _RINGS:
            place = cell[:, None] + ring * radius * direction
            clear = ((place >= fleet.motion_min) & (place <= fleet.motion_max)).all(axis=2)
            for obstacle in obstacles:
                clear &= np.linalg.norm(place - obstacle, axis=2) >= fleet.separation_min
            seen |= clear.any(axis=1)
        for magnitude in np.flatnonzero((fleet.radius[list(fleet.active)] >= radius).any(axis=0)):
            able[magnitude] |= seen
    return able
