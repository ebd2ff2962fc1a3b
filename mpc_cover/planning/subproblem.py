"""The convex subproblem: a QP around an iterate with the majoriser's terms and all constraints.

Columns: positions and velocities (`constraints.rows.Layout`), one slack for each cell near the edge of coverage, one
for each elastic row of separation, connectivity and passive safety.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from mpc_cover.constraints.boundary import bound_rows
from mpc_cover.constraints.box_overshoot import box_overshoot_rows
from mpc_cover.constraints.collision import collision_rows
from mpc_cover.constraints.cones import Cones, edge_cones, input_cones, speed_cones, stack_cones
from mpc_cover.constraints.connectivity import connectivity_rows
from mpc_cover.constraints.dynamics import dynamics_rows
from mpc_cover.constraints.facets import inscribed
from mpc_cover.constraints.limits import input_rows, speed_rows
from mpc_cover.constraints.pairs import all_pairs, pair_distances
from mpc_cover.constraints.passive_safety import braking_encounters, passive_safety_rows, stop_instants
from mpc_cover.constraints.rows import Layout, Rows, stack
from mpc_cover.coverage.majoriser import build_majoriser
from mpc_cover.planning.slacks import non_negative, number_slacks, slack_values, with_edge_slacks
from solvers.nlp import ConvexModel
from solvers.qp import QP, SecondOrderCones

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.coverage.majoriser import Majoriser
    from mpc_cover.model.fleet_constraints import FleetConstraints
    from mpc_cover.planning.ocp import OCP, Requirements, Settings

_NEGLIGIBLE = 1e-6
"""Share in a soft minimum below which a sample is left out of its row: it would only fill the factors. Plain choice."""
_SLACK_CURVATURE = 1e-8
"""Quadratic cost of slacks, which makes the QP strictly convex in them; a plain choice, negligible in the optimum."""


@dataclass(frozen=True, eq=False)
class Terms:
    """The majoriser in the form of the QP, around the iterate.

    Attributes
    ----------
    linear : ((N+1) m, d) gradient of the terms that stay positive within the trust region.
    curvature : ((N+1) m, d, d) positive semi-definite blocks.
    rows : slope . (q - qbar) - s <= -level, a row and a slack for each term near the edge of coverage.
    slack_cost : gamma of those terms.
    slack_value : their pos(level) at the iterate [m].
    """

    linear: FloatArray
    curvature: FloatArray
    rows: Rows
    slack_cost: FloatArray
    slack_value: FloatArray


def coverage_terms(layout: Layout, position: FloatArray, majoriser: Majoriser, radius: float) -> Terms:
    """Return the terms: those positive within the trust region are linear, those near 0 get slacks, others vanish."""
    samples = position.shape[0] * layout.agents
    reach = radius * np.abs(majoriser.slope).sum(axis=(1, 2))  # a term changes by at most this
    far = majoriser.level > reach
    near = np.flatnonzero(np.abs(majoriser.level) <= reach)
    linear = majoriser.gradient(far, samples)
    curvature = majoriser.curvature(majoriser.level > 0.0, samples)
    sample, slope = majoriser.sample[near], majoriser.slope[near]
    term, nth = np.nonzero(majoriser.share[near] >= _NEGLIGIBLE)
    sample, slope = sample[term, nth], slope[term, nth]
    column = (sample * layout.dimension)[:, None] + np.arange(layout.dimension)
    each = np.einsum("ed,ed->e", slope, position.reshape(samples, layout.dimension)[sample])
    here = np.bincount(term, each, near.size)
    rows = Rows(
        row=np.repeat(term, layout.dimension),
        column=column.ravel(),
        value=slope.ravel(),
        lower=np.full(near.size, -np.inf),
        upper=here - majoriser.level[near],
        elastic=np.arange(near.size),
    )
    return Terms(linear, curvature, rows, majoriser.weight[near], np.maximum(majoriser.level[near], 0.0))


def motion_rows(ocp: OCP, settings: Settings, layout: Layout, velocity: FloatArray) -> list[Rows]:
    """Return the hard rows of dynamics and limits, which every iterate satisfies."""
    dynamics = dynamics_rows(layout, ocp.period)
    if settings.exact_cones:
        return [dynamics]
    facets = inscribed(layout.dimension, settings.sides)
    shrink = settings.margins.limit_share
    return [
        dynamics,
        speed_rows(layout, velocity, shrink * ocp.fleet.speed_max, facets, ocp.first),
        input_rows(layout, velocity, shrink * ocp.fleet.input_max, ocp.period, facets),
    ]


def pair_rows(
    ocp: OCP,
    settings: Settings,
    required: Requirements,
    layout: Layout,
    motion: tuple[FloatArray, FloatArray],
    radius: float,
) -> list[Rows]:
    """Return the elastic rows of separation and connectivity around a motion (positions, velocities)."""
    fleet = ocp.fleet
    if fleet.size == 1:
        return []
    pairs, between = pair_distances(*motion, ocp.period), _chord_deviation(fleet, ocp.period)
    reach = 2.0 * radius * float(np.sqrt(layout.dimension))
    blocks = []
    if fleet.separation_min > 0.0:
        blocks.append(collision_rows(layout, pairs, required.separation, between, reach, ocp.first))
    if np.isfinite(fleet.communication_range) and not settings.exact_cones:
        facets = inscribed(layout.dimension, settings.edge_sides)
        slack = 0.5 * float(between.max())
        blocks.append(
            connectivity_rows(layout, pairs, required.range, slack, reach, facets, fleet=fleet, first=ocp.first)
        )
    return blocks


def _chord_deviation(fleet: FleetConstraints, period: float) -> FloatArray:
    """Return (pairs,) how much each distance may deviate from its chord between samples, a_rel T_s^2 / 8 [m]."""
    one, two = all_pairs(fleet.size)
    return np.asarray((fleet.input_max[one] + fleet.input_max[two]) * period**2 / 8.0)


def passive_safety_blocks(
    ocp: OCP, settings: Settings, layout: Layout, motion: tuple[FloatArray, FloatArray], radius: float
) -> list[Rows]:
    """Return the elastic rows of passive safety around a motion, where the fleet requires it."""
    fleet, reach = ocp.fleet, min(2.0 * radius, settings.stop_reach)
    if fleet.reaction_periods == 0:
        return []
    encounters = [
        braking_encounters(*motion, ocp.period, fleet, moment, reach)
        for moment in stop_instants(fleet.reaction_periods)
    ]
    rows = [passive_safety_rows(layout, *motion, ocp.period, fleet, found) for found in encounters]
    rows.append(box_overshoot_rows(layout, *motion, fleet, reach, ocp.first))
    return [block for block in rows if block.count]


def motion_cones(
    ocp: OCP,
    settings: Settings,
    required: Requirements,
    layout: Layout,
    motion: tuple[FloatArray, FloatArray],
    radius: float,
) -> list[Cones]:
    """Return limits and edges as cones, where the settings require them; those of edges come last and have slacks."""
    if not settings.exact_cones:
        return []
    fleet, shrink = ocp.fleet, settings.margins.limit_share
    blocks = [
        speed_cones(layout, shrink * fleet.speed_max, ocp.first),
        input_cones(layout, shrink * fleet.input_max, ocp.period),
    ]
    if fleet.size > 1 and np.isfinite(fleet.communication_range):
        pairs, slack = pair_distances(*motion, ocp.period), 0.5 * float(_chord_deviation(fleet, ocp.period).max())
        reach = 2.0 * radius * float(np.sqrt(layout.dimension))
        blocks.append(edge_cones(layout, pairs, required.range, slack, reach, fleet, ocp.first))
    return blocks


def build_subproblem(ocp: OCP, settings: Settings, required: Requirements, x: FloatArray, radius: float) -> ConvexModel:
    """Return the QP around the decision vector `x` with trust region `radius` [m]."""
    layout = Layout(ocp.steps, *ocp.fleet.start.shape)
    position, velocity = ocp.motion(x)
    majoriser = build_majoriser(position, ocp.cell, ocp.fleet.radius, ocp.weight, settings.softness, ocp.looks)
    terms = coverage_terms(layout, position, majoriser, radius)
    # between samples a coordinate deviates from its chord by at most u T_s^2 / 8
    between = (ocp.fleet.input_max * ocp.period**2 / 8.0)[:, None]
    box = (ocp.fleet.motion_min + between, ocp.fleet.motion_max - between)
    hard = motion_rows(ocp, settings, layout, velocity)
    hard += bound_rows(layout, position, box, radius, ocp.ends, ocp.fleet.lost)
    elastic = pair_rows(ocp, settings, required, layout, (position, velocity), radius)
    elastic += passive_safety_blocks(ocp, settings, layout, (position, velocity), radius)
    soft, slacks = number_slacks([terms.rows, *elastic], layout.size)
    cones = motion_cones(ocp, settings, required, layout, (position, velocity), radius)
    edge_slack, slacks = layout.size + slacks, slacks + sum(int((block.slack >= 0).sum()) for block in cones)
    matrix, lower, upper = stack([*hard, *soft, non_negative(layout.size, slacks)], layout.size + slacks)
    slack_cost = np.concatenate([terms.slack_cost, np.full(slacks - terms.slack_cost.size, settings.penalty)])
    iterate = np.concatenate([position.ravel(), velocity.ravel()])
    quadratic, linear = _cost(layout, terms, iterate, slack_cost, settings.proximal)
    start = np.concatenate([iterate, slack_values(matrix, upper, iterate, slacks)])
    exact = None
    if cones:
        exact = SecondOrderCones(*stack_cones(cones, layout.dimension, start.size, [edge_slack] * len(cones)))
        start = with_edge_slacks(start, exact, layout.dimension)
    qp = QP(quadratic, linear, matrix, lower, upper, exact)
    return _model(ocp, layout, qp, start, settings.penalty)


def _cost(
    layout: Layout, terms: Terms, iterate: FloatArray, slack_cost: FloatArray, proximal: float
) -> tuple[sp.csc_array[np.float64], FloatArray]:
    """Return P (upper triangle) and q of the QP: coverage terms, proximal term around the iterate, slacks."""
    size, dimension = layout.size, layout.dimension
    blocks = terms.curvature + proximal * np.eye(dimension)
    centred = np.einsum("nab,nb->na", blocks, iterate[: layout.half].reshape(-1, dimension))
    linear = np.concatenate([(terms.linear - centred).ravel(), -proximal * iterate[layout.half :], slack_cost])
    first = dimension * np.arange(blocks.shape[0])
    above, right = np.triu_indices(dimension)
    row = np.concatenate([(first[:, None] + above).ravel(), np.arange(layout.half, size + slack_cost.size)])
    column = np.concatenate([(first[:, None] + right).ravel(), np.arange(layout.half, size + slack_cost.size)])
    value = np.concatenate(
        [blocks[:, above, right].ravel(), np.full(layout.half, proximal), np.full(slack_cost.size, _SLACK_CURVATURE)]
    )
    total = size + slack_cost.size
    quadratic = sp.csc_array((value, (row, column)), shape=(total, total))
    quadratic.sum_duplicates()
    return quadratic, linear


def _model(ocp: OCP, layout: Layout, qp: QP, start: FloatArray, weight: float) -> ConvexModel:
    """Return the QP with its maps back to decision vectors, predicted decreases and step lengths."""

    def cost(point: FloatArray) -> float:
        product = qp.P @ point
        diagonal = qp.P.diagonal() * point
        return float(point @ product - 0.5 * point @ diagonal + qp.q @ point)

    here = cost(start)

    def recover(point: FloatArray) -> FloatArray:
        start = layout.agents * layout.dimension
        return ocp.exact_ends(np.concatenate([point[:start], point[layout.half : layout.size]]))

    def predicted(point: FloatArray) -> float:
        return here - cost(point)

    def length(x: FloatArray) -> float:
        moved = ocp.motion(x)[0].ravel() - start[: layout.half]
        return float(np.abs(moved).max())

    return ConvexModel(qp=qp, recover=recover, predicted=predicted, weight=weight, start=start, length=length)
