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
from mpc_cover.constraints.control_points import (
    box_control_rows,
    collision_control_rows,
    connectivity_control_rows,
    control_points,
    has_long_steps,
)
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
    from mpc_cover.arrays import BoolArray, FloatArray
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
    velocity_linear, velocity_curvature : the like of velocities, see `_velocity_terms`; left out where all looks are at
        samples.
    rows : slope . (q - qbar) - s <= -level, a row and a slack for each term near the edge of coverage.
    slack_cost : gamma of those terms.
    slack_value : their pos(level) at the iterate [m].
    """

    linear: FloatArray
    curvature: FloatArray
    rows: Rows
    slack_cost: FloatArray
    slack_value: FloatArray
    velocity_linear: FloatArray | None = None
    velocity_curvature: tuple[FloatArray, ...] = ()


def coverage_terms(
    layout: Layout,
    position: FloatArray,
    majoriser: Majoriser,
    radius: float,
    *,
    velocity: FloatArray | None = None,
    swing: FloatArray | None = None,
) -> Terms:
    """Return the terms: those positive within the trust region are linear, those near 0 get slacks, others vanish.

    Where looks count between samples, points depend on `velocity` (N+1, m, d) [m/s], and `swing` is u_max T^2 (m,).
    """
    samples = position.shape[0] * layout.agents
    reach = radius * np.abs(majoriser.slope).sum(axis=(1, 2))  # a term changes by at most this
    if swing is not None and majoriser.bow is not None:
        size = np.linalg.norm(majoriser.slope, axis=2)
        reach = reach + (size * majoriser.bow * swing[majoriser.sample % layout.agents]).sum(axis=1)
    far = majoriser.level > reach
    near = np.flatnonzero(np.abs(majoriser.level) <= reach)
    linear = majoriser.gradient(far, samples)
    curvature = majoriser.curvature(majoriser.level > 0.0, samples)
    sample, slope = majoriser.sample[near], majoriser.slope[near]
    term, nth = np.nonzero(majoriser.share[near] >= _NEGLIGIBLE)
    sample, slope = sample[term, nth], slope[term, nth]
    column = (sample * layout.dimension)[:, None] + np.arange(layout.dimension)
    each = np.einsum("ed,ed->e", slope, position.reshape(samples, layout.dimension)[sample])
    entries = [(term, column, slope)]
    velocity_linear: FloatArray | None = None
    velocity_curvature: tuple[FloatArray, ...] = ()
    if majoriser.blend is not None and velocity is not None:
        before, after = (factor[near][term, nth] for factor in majoriser.blend)
        following = np.minimum(sample + layout.agents, sample + (samples - 1 - sample) // layout.agents * layout.agents)
        for factor, owner in ((before, sample), (after, following)):
            some = factor > 0.0
            there = layout.half + (owner[some] * layout.dimension)[:, None] + np.arange(layout.dimension)
            part = factor[some, None] * slope[some]
            each += np.bincount(
                np.flatnonzero(some), np.einsum("ed,ed->e", part, velocity.reshape(samples, -1)[owner[some]]), each.size
            )
            entries.append((term[some], there, part))
        velocity_linear, velocity_curvature = _velocity_terms(majoriser, far, samples, layout.agents)
    here = np.bincount(term, each, near.size)
    rows = Rows(
        row=np.concatenate([np.repeat(row, layout.dimension) for row, _, _ in entries]),
        column=np.concatenate([columns.ravel() for _, columns, _ in entries]),
        value=np.concatenate([values.ravel() for _, _, values in entries]),
        lower=np.full(near.size, -np.inf),
        upper=here - majoriser.level[near],
        elastic=np.arange(near.size),
    )
    cost, value = majoriser.weight[near], np.maximum(majoriser.level[near], 0.0)
    return Terms(linear, curvature, rows, cost, value, velocity_linear, velocity_curvature)


def _velocity_terms(
    majoriser: Majoriser, far: BoolArray, samples: int, agents: int
) -> tuple[FloatArray, tuple[FloatArray, ...]]:
    """Return the gradient ((N+1) m, d) of far terms by velocities, and five kinds of blocks of curvature.

    Blocks ((N+1) m, d, d) belong to the sample before: q v, q v+, v v, v v+, v+ v+, with v+ at the sample after.
    """
    assert majoriser.blend is not None
    before, after = majoriser.blend
    positive = majoriser.level > 0.0
    linear = majoriser.gradient(far, samples, before)
    linear[agents:] += majoriser.gradient(far, samples, after)[:-agents]
    factors = (before, after, before**2, before * after, after**2)
    return linear, tuple(majoriser.curvature(positive, samples, factor) for factor in factors)


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
    long = has_long_steps(fleet, ocp.period)
    one, two = all_pairs(fleet.size)
    points = control_points(*motion, ocp.period)
    control, bow = points[:, one] - points[:, two], 2.0 * between
    if long:
        between = np.zeros_like(between)
    if fleet.separation_min > 0.0:
        blocks.append(collision_rows(layout, pairs, required.separation, between, reach, ocp.first))
        if long:
            near = reach + float(bow.max())
            blocks.append(collision_control_rows(layout, pairs, control, required.separation, near, ocp.period))
    if np.isfinite(fleet.communication_range) and not settings.exact_cones:
        facets = inscribed(layout.dimension, settings.edge_sides)
        slack = 0.5 * float(between.max())
        blocks.append(
            connectivity_rows(layout, pairs, required.range, slack, reach, facets, fleet=fleet, first=ocp.first)
        )
        if long:
            asked = (required.range, reach + 2.0 * float(bow.max()), facets)
            blocks.append(connectivity_control_rows(layout, pairs, control, *asked, fleet=fleet, period=ocp.period))
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
    between = ocp.between(velocity)
    asked = (ocp.cell, ocp.fleet.radius, ocp.weight)
    majoriser = build_majoriser(position, *asked, settings.softness, ocp.looks, between)
    swing = None if between is None else ocp.fleet.input_max * ocp.period**2
    terms = coverage_terms(layout, position, majoriser, radius, velocity=velocity, swing=swing)
    # between samples a coordinate deviates from its chord by at most u T_s^2 / 8
    long = has_long_steps(ocp.fleet, ocp.period)
    aside = (0.0 if long else 1.0) * (ocp.fleet.input_max * ocp.period**2 / 8.0)[:, None]
    box = (ocp.fleet.motion_min + aside, ocp.fleet.motion_max - aside)
    hard = motion_rows(ocp, settings, layout, velocity)
    if long:
        walls = (ocp.fleet.motion_min, ocp.fleet.motion_max)
        hard.append(box_control_rows(layout, position, velocity, ocp.period, walls))
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
    cross: sp.csc_array[np.float64] | None = None
    if terms.velocity_linear is not None:
        cross = _velocity_curvature(layout, terms.velocity_curvature, size + slack_cost.size)
        linear[layout.half : size] += terms.velocity_linear.ravel()
        here = np.concatenate([iterate, np.zeros(slack_cost.size)])
        linear -= cross @ here + cross.T @ here - cross.diagonal() * here
    first = dimension * np.arange(blocks.shape[0])
    above, right = np.triu_indices(dimension)
    row = np.concatenate([(first[:, None] + above).ravel(), np.arange(layout.half, size + slack_cost.size)])
    column = np.concatenate([(first[:, None] + right).ravel(), np.arange(layout.half, size + slack_cost.size)])
    value = np.concatenate(
        [blocks[:, above, right].ravel(), np.full(layout.half, proximal), np.full(slack_cost.size, _SLACK_CURVATURE)]
    )
    total = size + slack_cost.size
    quadratic = sp.csc_array((value, (row, column)), shape=(total, total))
    if cross is not None:
        quadratic = sp.csc_array(quadratic + cross)
    quadratic.sum_duplicates()
    return quadratic, linear


def _velocity_curvature(layout: Layout, blocks: tuple[FloatArray, ...], columns: int) -> sp.csc_array[np.float64]:
    """Return the curvature of points between samples that involves velocities (upper triangle), (columns, columns)."""
    dimension = layout.dimension
    sample = np.arange((layout.steps + 1) * layout.agents)
    q = dimension * sample
    v, later = layout.half + q, layout.half + q + dimension * layout.agents
    rows, places, values = [], [], []
    for block, (row, column) in zip(blocks, ((q, v), (q, later), (v, v), (v, later), (later, later)), strict=True):
        live = np.flatnonzero(block.any(axis=(1, 2)))
        first, second = np.indices((dimension, dimension))
        keep = first <= second if row is column else np.ones_like(first, dtype=bool)
        rows.append((row[live, None] + first[keep]).ravel())
        places.append((column[live, None] + second[keep]).ravel())
        values.append(block[live][:, keep].ravel())
    data = (np.concatenate(values), (np.concatenate(rows), np.concatenate(places)))
    return sp.csc_array(data, shape=(columns, columns))


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
