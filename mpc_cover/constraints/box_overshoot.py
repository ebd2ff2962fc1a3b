"""Room to stop inside the box: whoever dies brakes straight on, and that must not take it out of the box (4.15)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.rows import elastic_rows
from mpc_cover.model.braking import braking_distance_gradient

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.constraints.rows import Layout, Rows
    from mpc_cover.model.fleet_constraints import FleetConstraints

_SPARE = 0.01
"""Asked for inside the box [m]."""


def box_overshoot(position: FloatArray, velocity: FloatArray, fleet: FleetConstraints) -> FloatArray:
    """Return by how much [m], (2, N+1, m, d), braking takes agents out of the box at its low and high sides."""
    return np.maximum(_beyond(position, velocity, fleet), 0.0)


def box_overshoot_rows(
    layout: Layout, position: FloatArray, velocity: FloatArray, fleet: FleetConstraints, reach: float, first: int
) -> Rows:
    """Return rows that keep stopping points in the box, where the iterate (N+1, m, d) has less than `reach` to spare.

    q + |v| v / (2 u_max), linearised; samples before `first` are given.
    """
    beyond = _beyond(position, velocity, fleet)
    beyond[:, :first] = -np.inf
    side, sample, agent, axis = np.nonzero(beyond > -reach)
    normal = np.eye(layout.dimension)[axis] * np.where(side == 0, -1.0, 1.0)[:, None]
    speed = velocity[sample, agent]
    slope = braking_distance_gradient(normal, speed, np.full(side.size, np.inf), fleet.input_max[agent])
    column = np.concatenate(
        [
            layout.position(sample, agent)[:, None] + np.arange(layout.dimension),
            layout.velocity(sample, agent)[:, None] + np.arange(layout.dimension),
        ],
        axis=1,
    )
    value = np.concatenate([normal, slope], axis=1)
    iterate = np.concatenate([position[sample, agent], speed], axis=1)
    upper = np.einsum("re,re->r", value, iterate) - beyond[side, sample, agent, axis]
    return elastic_rows(column, value, upper)


def _beyond(position: FloatArray, velocity: FloatArray, fleet: FleetConstraints) -> FloatArray:
    """Return how far (2, N+1, m, d) [m] stopping points are beyond the low and the high sides; the lost stay."""
    speed = np.linalg.norm(velocity, axis=2, keepdims=True)
    end = position + speed / (2.0 * fleet.input_max[:, None]) * velocity
    # whoever is outside already goes no farther out
    low = np.minimum(fleet.motion_min + _SPARE, position)
    high = np.maximum(fleet.motion_max - _SPARE, position)
    beyond = np.stack([low - end, end - high])
    beyond[:, :, list(fleet.lost)] = -np.inf
    return beyond
