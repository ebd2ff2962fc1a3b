"""Long steps: constraints on the Bezier control points of a path instead of margins for what it may leave its chord by.

Under a zero-order hold the path of an interval is a parabola within the triangle of q_n, c_n = q_n + T/2 v_n and
q_(n+1): what is convex, a box, a half-space, a polytope of differences, holds along it if it holds at these three. The
margins u T^2 / 8 that samples alone would need are of the size of the field where steps are long.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.collision import separating_normals
from mpc_cover.constraints.facets import Facets, turned_normals
from mpc_cover.constraints.graph import fleet_trees
from mpc_cover.constraints.pairs import PairDistances, all_pairs
from mpc_cover.constraints.rows import Layout, Rows, elastic_rows

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.model.fleet_constraints import FleetConstraints

_LONG = 0.1
"""Deviation from the chord, in smallest sensing radii, from which on steps are long; a plain choice: rows cost time,
and shorter steps lose next to nothing."""


def has_long_steps(fleet: FleetConstraints, period: float) -> bool:
    """Return whether u_max T^2 / 8 is so much that constraints are put on control points; `period` T [s]."""
    finite = fleet.radius[np.isfinite(fleet.radius)]
    return bool(finite.size and float(fleet.input_max.max()) * period**2 / 8.0 > _LONG * float(finite.min()))


def control_points(position: FloatArray, velocity: FloatArray, period: float) -> FloatArray:
    """Return c_n (N, ...) [m] of a motion (N+1, ...) [m], [m/s]."""
    return np.asarray(position[:-1] + 0.5 * period * velocity[:-1])


def box_control_rows(
    layout: Layout, position: FloatArray, velocity: FloatArray, period: float, box: tuple[FloatArray, FloatArray]
) -> Rows:
    """Return box[0] <= c_n <= box[1], (d,) [m] each; a control point outside may stay where it is."""
    here = control_points(position, velocity, period)
    each = np.arange(here.size)
    return Rows(
        row=np.tile(each, 2),
        column=np.concatenate([each, layout.half + each]),
        value=np.concatenate([np.ones(here.size), np.full(here.size, 0.5 * period)]),
        lower=np.minimum(box[0], here).ravel(),
        upper=np.maximum(box[1], here).ravel(),
    )


def collision_control_rows(
    layout: Layout, pairs: PairDistances, control: FloatArray, required: FloatArray, reach: float, period: float
) -> Rows:
    """Return nbar . (c_i - c_j) >= required, with the half-spaces of `collision.collision_rows`.

    `control` is (N, pairs, d) [m] differences of control points at the iterate, which may stay as near as they are.
    """
    interval, pair, normal = separating_normals(layout, pairs, required + reach)
    reached = np.einsum("rd,rd->r", normal, control[interval, pair])
    bound = np.minimum(required[pair], reached)
    return _elastic(layout, interval, pair, -normal, -bound, np.arange(interval.size), period)


def connectivity_control_rows(
    layout: Layout,
    pairs: PairDistances,
    control: FloatArray,
    allowed: float,
    reach: float,
    facets: Facets,
    *,
    fleet: FleetConstraints,
    period: float,
) -> Rows:
    """Return ||c_i - c_j|| <= allowed for the edges of each interval's tree, as `connectivity.connectivity_rows`."""
    interval, pair = np.nonzero(fleet_trees(pairs.most, fleet))
    difference = control[interval, pair]
    bound = np.maximum(allowed, np.linalg.norm(difference, axis=1)) * facets.shrink
    normal = turned_normals(facets, difference)
    both = np.concatenate([normal, -normal], axis=1)
    along = np.einsum("efd,ed->ef", both, difference)
    edge, facet = np.nonzero(along + reach > bound[:, None])
    _, slack = np.unique(edge, return_inverse=True)
    chosen = both[edge, facet]
    return _elastic(layout, interval[edge], pair[edge], chosen, bound[edge], np.asarray(slack, dtype=np.intp), period)


def _elastic(
    layout: Layout,
    interval: IntArray,
    pair: IntArray,
    normal: FloatArray,
    upper: FloatArray,
    slack: IntArray,
    period: float,
) -> Rows:
    """Return rows normal . (c_i - c_j)(interval) - s <= upper."""
    axes, ends = np.arange(layout.dimension), all_pairs(layout.agents)
    places = [at(interval, end[pair])[:, None] + axes for at in (layout.position, layout.velocity) for end in ends]
    half = 0.5 * period * normal
    return elastic_rows(
        np.concatenate(places, axis=1), np.concatenate([normal, -normal, half, -half], axis=1), upper, slack
    )
