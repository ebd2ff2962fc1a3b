"""The convex subproblem in CVXPY: the reference formulation of `subproblem`.

Tests compare the hand-assembled QP with it. A researcher can append terms to `terms` or constraints to
`constraints` and solve with any CVXPY solver. Canonicalisation makes it too slow for a control loop.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from mpc_cover.constraints.box_overshoot import box_overshoot_rows
from mpc_cover.constraints.collision import collision_rows
from mpc_cover.constraints.cones import edge_cones
from mpc_cover.constraints.connectivity import connectivity_rows
from mpc_cover.constraints.control_points import (
    collision_control_rows,
    connectivity_control_rows,
    control_points,
    has_long_steps,
)
from mpc_cover.constraints.facets import inscribed, turned_normals
from mpc_cover.constraints.pairs import all_pairs, pair_distances
from mpc_cover.constraints.passive_safety import braking_encounters, passive_safety_rows, stop_instants
from mpc_cover.constraints.rows import Layout
from mpc_cover.coverage.majoriser import build_majoriser

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.constraints.rows import Rows
    from mpc_cover.coverage.majoriser import Majoriser
    from mpc_cover.planning.ocp import OCP, Requirements, Settings


@dataclass(eq=False)
class CvxpySubproblem:
    """The subproblem around an iterate, as CVXPY expressions.

    Attributes
    ----------
    position, velocity, force : lists over samples of (m, d) expressions [m], [m/s], [m/s^2].
    terms : convex terms of the objective; their sum is minimised.
    constraints : CVXPY constraints.
    """

    position: list[Any]
    velocity: list[Any]
    force: list[Any]
    terms: list[Any]
    constraints: list[Any]

    def problem(self) -> Any:
        """Return the CVXPY problem, appended terms and constraints included."""
        return cp.Problem(cp.Minimize(sum(self.terms)), self.constraints)

    def solve(self, solver: str = "CLARABEL", **options: Any) -> float:
        """Solve and return the optimal value."""
        return float(self.problem().solve(solver=solver, **options))


def build_cvxpy_subproblem(
    ocp: OCP, settings: Settings, required: Requirements, x: FloatArray, radius: float
) -> CvxpySubproblem:
    """Return the convex subproblem around the decision vector `x`; arguments as in `subproblem.build_subproblem`."""
    bar_q, bar_v = ocp.motion(x)
    shape = ocp.fleet.start.shape
    force = [cp.Variable(shape) for _ in range(ocp.steps)]
    position, velocity = [cp.Variable(shape)], [cp.Variable(shape)]
    step = ocp.period
    constraints: list[Any] = []
    for u in force:
        q, v = cp.Variable(shape), cp.Variable(shape)
        constraints += [q == position[-1] + step * velocity[-1] + 0.5 * step**2 * u, v == velocity[-1] + step * u]
        position.append(q)
        velocity.append(v)
    found = CvxpySubproblem(position, velocity, force, [], constraints)
    _add_limits(found, ocp, settings, bar_v)
    _add_bounds(found, ocp, (bar_q, bar_v), radius)
    _add_coverage(found, ocp, settings, (bar_q, bar_v), radius)
    _add_pairs(found, ocp, settings, required, (bar_q, bar_v), radius)
    _add_passive_safety(found, ocp, settings, (bar_q, bar_v), radius)
    for bar, now in ((bar_q, position), (bar_v, velocity)):
        change = cp.vstack([now[n] - bar[n] for n in range(ocp.steps + 1)])
        found.terms.append(0.5 * settings.proximal * cp.sum_squares(change))
    return found


def _add_limits(found: CvxpySubproblem, ocp: OCP, settings: Settings, bar_v: FloatArray) -> None:
    """Add speed and input limits (4.13, 4.14), as polytopes inscribed in their discs or as cones."""
    facets = inscribed(ocp.fleet.dimension, settings.sides)
    share = settings.margins.limit_share * (1.0 if settings.exact_cones else facets.shrink)
    for i in range(ocp.fleet.size):
        if settings.exact_cones:
            found.constraints += [cp.norm(v[i]) <= share * ocp.fleet.speed_max[i] for v in found.velocity[ocp.first :]]
            found.constraints += [cp.norm(u[i]) <= share * ocp.fleet.input_max[i] for u in found.force]
            continue
        for n in range(ocp.first, ocp.steps + 1):
            speed = turned_normals(facets, bar_v[n])[i]
            found.constraints.append(cp.abs(speed @ found.velocity[n][i]) <= share * ocp.fleet.speed_max[i])
        for n, u in enumerate(found.force):
            force = turned_normals(facets, bar_v[n + 1] - bar_v[n])[i]
            found.constraints.append(cp.abs(force @ u[i]) <= share * ocp.fleet.input_max[i])


def _add_bounds(found: CvxpySubproblem, ocp: OCP, motion: tuple[FloatArray, FloatArray], radius: float) -> None:
    """Add the motion box (4.15, 4.16), the trust region and the boundary conditions (4.17)."""
    bar_q, bar_v = motion
    fleet, ends = ocp.fleet, ocp.ends
    between = (fleet.input_max * ocp.period**2 / 8.0)[:, None]  # deviation of a path from its chord
    if has_long_steps(fleet, ocp.period):
        between = 0.0 * between
        for n in range(ocp.steps):
            here = bar_q[n] + 0.5 * ocp.period * bar_v[n]
            control = found.position[n] + 0.5 * ocp.period * found.velocity[n]
            found.constraints += [
                control >= np.minimum(fleet.motion_min, here),
                control <= np.maximum(fleet.motion_max, here),
            ]
    given = {0: ends.start_position, ocp.steps: ends.end_position}
    for n in range(ocp.steps + 1):
        if given.get(n) is not None:
            found.constraints.append(found.position[n] == given[n])
            continue
        lower = np.maximum(bar_q[n] - radius, np.minimum(fleet.motion_min + between, bar_q[n]))
        upper = np.minimum(bar_q[n] + radius, np.maximum(fleet.motion_max - between, bar_q[n]))
        found.constraints += [found.position[n] >= lower, found.position[n] <= upper]
    for i in fleet.lost:
        found.constraints += [q[i] == bar_q[0, i] for q in found.position]
    for n, velocity in ((0, ends.start_velocity), (ocp.steps, ends.end_velocity)):
        if velocity is not None:
            found.constraints.append(found.velocity[n] == velocity)
    if ends.closed:
        found.constraints += [found.position[-1] == found.position[0], found.velocity[-1] == found.velocity[0]]


def _add_coverage(
    found: CvxpySubproblem, ocp: OCP, settings: Settings, motion: tuple[FloatArray, FloatArray], radius: float
) -> None:
    """Add sum gamma pos(level + sum slope . (q - qbar)), and the curvature of the terms above zero."""
    bar_q, bar_v = motion
    between, asked = ocp.between(bar_v), (ocp.cell, ocp.fleet.radius, ocp.weight)
    majoriser = build_majoriser(bar_q, *asked, settings.softness, ocp.looks, between)
    if between is not None:
        _add_coverage_between(found, ocp, majoriser, motion, radius)
        return
    agents, dimension = ocp.fleet.start.shape
    reach = radius * np.sqrt(dimension)
    moved = cp.vec(cp.vstack([found.position[n] - bar_q[n] for n in range(ocp.steps + 1)]), order="C")
    terms, count = majoriser.sample.shape
    row = np.repeat(np.arange(terms), count * dimension)
    column = (majoriser.sample[:, :, None] * dimension + np.arange(dimension)).ravel()
    slope = sp.csr_array((majoriser.slope.ravel(), (row, column)), shape=(terms, moved.size))
    far = np.flatnonzero(majoriser.level > reach)
    near = np.flatnonzero(np.abs(majoriser.level) <= reach)
    if far.size:
        found.terms.append(majoriser.weight[far] @ (majoriser.level[far] + slope[far] @ moved))
    if near.size:
        found.terms.append(majoriser.weight[near] @ cp.pos(majoriser.level[near] + slope[near] @ moved))
    blocks = majoriser.curvature(majoriser.level > 0.0, (ocp.steps + 1) * agents)
    found.terms.append(0.5 * cp.quad_form(moved, cp.psd_wrap(sp.block_diag(list(blocks), format="csc"))))


def _add_coverage_between(
    found: CvxpySubproblem, ocp: OCP, majoriser: Majoriser, motion: tuple[FloatArray, FloatArray], radius: float
) -> None:
    """Add the same for terms of points between samples, q_n + a v_n + b v_(n+1)."""
    assert majoriser.blend is not None
    assert majoriser.bow is not None
    agents, dimension = ocp.fleet.start.shape
    half = motion[0].size
    parts = [
        now[n] - bar[n]
        for bar, now in zip(motion, (found.position, found.velocity), strict=True)
        for n in range(ocp.steps + 1)
    ]
    moved = cp.vec(cp.vstack(parts), order="C")
    rows, bends, reach = [], [], np.zeros(majoriser.level.size)
    for (term, nth), flat in np.ndenumerate(majoriser.sample):
        n, i = divmod(int(flat), agents)
        point = np.zeros((dimension, 2 * half))  # the point's change of the state's change
        for column, factor in (
            (flat, 1.0),
            (half // dimension + flat, majoriser.blend[0][term, nth]),
            (half // dimension + min(n + 1, ocp.steps) * agents + i, majoriser.blend[1][term, nth]),
        ):
            point[:, int(column) * dimension : (int(column) + 1) * dimension] += factor * np.eye(dimension)
        slope = majoriser.slope[term, nth]
        rows.append(slope @ point)
        swing = majoriser.bow[term, nth] * ocp.fleet.input_max[i] * ocp.period**2
        reach[term] += radius * np.abs(slope).sum() + swing * np.linalg.norm(slope)
        if majoriser.level[term] > 0.0:
            bends.append(np.sqrt(majoriser.weight[term]) * majoriser.across(term, nth) @ point)
    change = sp.csr_array(np.array(rows).reshape(*majoriser.sample.shape, -1).sum(axis=1))
    level, weight = majoriser.level, majoriser.weight
    if bends:
        found.terms.append(0.5 * cp.sum_squares(sp.csr_array(np.concatenate(bends)) @ moved))
    far, near = np.flatnonzero(level > reach), np.flatnonzero(np.abs(level) <= reach)
    if far.size:
        found.terms.append(weight[far] @ (level[far] + change[far] @ moved))
    if near.size:
        found.terms.append(weight[near] @ cp.pos(level[near] + change[near] @ moved))


def _add_pairs(
    found: CvxpySubproblem,
    ocp: OCP,
    settings: Settings,
    required: Requirements,
    motion: tuple[FloatArray, FloatArray],
    radius: float,
) -> None:
    """Add separation and connectivity with elastic half-spaces (4.18, 4.20)."""
    fleet, layout = ocp.fleet, Layout(ocp.steps, *ocp.fleet.start.shape)
    if fleet.size == 1:
        return
    pairs = pair_distances(*motion, ocp.period)
    one, two = all_pairs(fleet.size)
    between = (fleet.input_max[one] + fleet.input_max[two]) * ocp.period**2 / 8.0
    reach = 2.0 * radius * float(np.sqrt(layout.dimension))
    long, bow = has_long_steps(fleet, ocp.period), 2.0 * float(between.max())
    points = control_points(*motion, ocp.period)
    control = points[:, one] - points[:, two]
    if long:
        between = np.zeros_like(between)
    if fleet.separation_min > 0.0:
        rows = collision_rows(layout, pairs, required.separation, between, reach, ocp.first)
        _add_elastic(found, rows, settings.penalty)
        if long:
            rows = collision_control_rows(layout, pairs, control, required.separation, reach + bow, ocp.period)
            _add_elastic(found, rows, settings.penalty)
    if np.isfinite(fleet.communication_range) and settings.exact_cones:
        cones = edge_cones(layout, pairs, required.range, 0.5 * float(between.max()), reach, fleet, ocp.first)
        for bound, plus, minus in zip(cones.bound, cones.plus, cones.minus, strict=True):
            (n, i), (_, j) = (divmod(int(c) // layout.dimension, layout.agents) for c in (plus, minus))
            found.terms.append(settings.penalty * cp.pos(cp.norm(found.position[n][i] - found.position[n][j]) - bound))
    elif np.isfinite(fleet.communication_range):
        facets = inscribed(layout.dimension, settings.edge_sides)
        slack = 0.5 * float(between.max())
        rows = connectivity_rows(layout, pairs, required.range, slack, reach, facets, fleet=fleet, first=ocp.first)
        _add_elastic(found, rows, settings.penalty)
        if long:
            near = (required.range, reach + 2.0 * bow, facets)
            rows = connectivity_control_rows(layout, pairs, control, *near, fleet=fleet, period=ocp.period)
            _add_elastic(found, rows, settings.penalty)


def _add_passive_safety(
    found: CvxpySubproblem, ocp: OCP, settings: Settings, motion: tuple[FloatArray, FloatArray], radius: float
) -> None:
    """Add elastic half-spaces of passive safety: braking agents are not hit and stay inside the box."""
    fleet, layout = ocp.fleet, Layout(ocp.steps, *ocp.fleet.start.shape)
    if fleet.reaction_periods == 0:
        return
    reach = min(2.0 * radius, settings.stop_reach)
    for moment in stop_instants(fleet.reaction_periods):
        encounters = braking_encounters(*motion, ocp.period, fleet, moment, reach)
        _add_elastic(found, passive_safety_rows(layout, *motion, ocp.period, fleet, encounters), settings.penalty)
    _add_elastic(found, box_overshoot_rows(layout, *motion, fleet, reach, ocp.first), settings.penalty)


def _add_elastic(found: CvxpySubproblem, rows: Rows, penalty: float) -> None:
    """Add rows with an l1 penalty: rows that share a slack are penalised by the largest violation among them."""
    if rows.count == 0 or rows.elastic is None:
        return
    stacked = cp.hstack([cp.vec(part, order="C") for part in (*found.position, *found.velocity)])
    normal = sp.csr_array((rows.value, (rows.row, rows.column)), shape=(rows.count, stacked.size))
    slack = cp.Variable(rows.slacks, nonneg=True)
    found.constraints.append(normal @ stacked - slack[rows.elastic] <= rows.upper)
    found.terms.append(penalty * cp.sum(slack))
