"""Passive safety with respect to the motion box (4.15): an agent that brakes straight on stops inside the box."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.rows import elastic_rows
from mpc_cover.model.braking import braking_distance_gradient

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.constraints.rows import Layout, Rows
    from mpc_cover.model.fleet_constraints import FleetConstraints

_MARGIN = 0.01
"""Margin inside the box that stopping points keep [m], for tolerances of the QP; the size of `ocp.Margins`."""


def box_overshoot(position: FloatArray, velocity: FloatArray, fleet: FleetConstraints) -> FloatArray:
    """Return by how much [m], (2, N+1, m, d), stopping points lie beyond the low and high sides of the box."""
    return np.maximum(_beyond(position, velocity, fleet), 0.0)


def box_overshoot_rows(
    layout: Layout, position: FloatArray, velocity: FloatArray, fleet: FleetConstraints, reach: float, first: int
) -> Rows:
    """Return elastic rows that keep stopping points in the box, where the iterate (N+1, m, d) is within `reach` [m].

    The stopping point q + |v| v / (2 u_max) is linearised; samples before `first` are given.
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
    """Return how far (2, N+1, m, d) [m] stopping points are beyond the low and high sides; -inf for lost agents."""
    speed = np.linalg.norm(velocity, axis=2, keepdims=True)
    end = position + speed / (2.0 * fleet.input_max[:, None]) * velocity
    # an agent outside the box may not move farther out
    low = np.minimum(fleet.motion_min + _MARGIN, position)
    high = np.maximum(fleet.motion_max - _MARGIN, position)
    beyond = np.stack([low - end, end - high])
    beyond[:, :, list(fleet.lost)] = -np.inf
    return beyond
