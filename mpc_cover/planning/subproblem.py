"""The convex subproblem: a QP around an iterate with the majoriser's terms and all constraints.

Columns: positions and velocities (`constraints.rows.Layout`), one slack for each cell near the edge of coverage, one
for each elastic row of separation, connectivity and passive safety.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

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
from mpc_cover.model.motion import chord_deviation
from mpc_cover.planning.coverage_terms import coverage_qp_cost, coverage_terms
from mpc_cover.planning.slacks import non_negative, number_slacks, slack_values, with_edge_slacks
from solvers.nlp import ConvexModel
from solvers.qp import QP, SecondOrderCones

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.model.fleet_constraints import FleetConstraints
    from mpc_cover.planning.ocp import OCP, Requirements, Settings


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
    if has_long_steps(fleet, ocp.period):
        return _long_pair_rows(ocp, settings, required, layout, motion, radius)
    pairs, between = pair_distances(*motion, ocp.period), _chord_deviation(fleet, ocp.period)
    reach = 2.0 * radius * float(np.sqrt(layout.dimension))
    blocks = []
    if fleet.separation_min > 0.0:
        blocks.append(collision_rows(layout, pairs, required.separation, between, reach, ocp.first))
    if np.isfinite(fleet.communication_range) and not settings.exact_cones:
        asked = (required.range, 0.5 * float(between.max()), reach, inscribed(layout.dimension, settings.edge_sides))
        blocks.append(connectivity_rows(layout, pairs, *asked, fleet=fleet, first=ocp.first))
    return blocks


def _long_pair_rows(
    ocp: OCP,
    settings: Settings,
    required: Requirements,
    layout: Layout,
    motion: tuple[FloatArray, FloatArray],
    radius: float,
) -> list[Rows]:
    """Return the rows of `pair_rows` for long steps: without margins at samples, and at control points in between."""
    fleet, pairs = ocp.fleet, pair_distances(*motion, ocp.period)
    one, two = all_pairs(fleet.size)
    points = control_points(*motion, ocp.period)
    control, bow = points[:, one] - points[:, two], 2.0 * float(_chord_deviation(fleet, ocp.period).max())
    reach = 2.0 * radius * float(np.sqrt(layout.dimension))
    blocks = []
    if fleet.separation_min > 0.0:
        no_margin = np.zeros(one.size)
        blocks.append(collision_rows(layout, pairs, required.separation, no_margin, reach, ocp.first))
        blocks.append(collision_control_rows(layout, pairs, control, required.separation, reach + bow, ocp.period))
    if np.isfinite(fleet.communication_range) and not settings.exact_cones:
        facets = inscribed(layout.dimension, settings.edge_sides)
        blocks.append(
            connectivity_rows(layout, pairs, required.range, 0.0, reach, facets, fleet=fleet, first=ocp.first)
        )
        asked = (required.range, reach + 2.0 * bow, facets)
        blocks.append(connectivity_control_rows(layout, pairs, control, *asked, fleet=fleet, period=ocp.period))
    return blocks


def _chord_deviation(fleet: FleetConstraints, period: float) -> FloatArray:
    """Return (pairs,) how much each distance may deviate from its chord between samples, a_rel T_s^2 / 8 [m]."""
    one, two = all_pairs(fleet.size)
    return chord_deviation(fleet.input_max[one] + fleet.input_max[two], period)


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
    aside = (0.0 if long else 1.0) * chord_deviation(ocp.fleet.input_max, ocp.period)[:, None]
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
    quadratic, linear = coverage_qp_cost(layout, terms, iterate, slack_cost, settings.proximal)
    start = np.concatenate([iterate, slack_values(matrix, upper, iterate, slacks)])
    exact = None
    if cones:
        exact = SecondOrderCones(*stack_cones(cones, layout.dimension, start.size, [edge_slack] * len(cones)))
        start = with_edge_slacks(start, exact, layout.dimension)
    qp = QP(quadratic, linear, matrix, lower, upper, exact)
    return _model(ocp, layout, qp, start, settings.penalty)


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
