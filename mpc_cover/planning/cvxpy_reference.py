"""The convex subproblem in CVXPY: the reference formulation of `subproblem`.

Tests compare the hand-assembled QP with it. `planning.cvxpy_scp` appends the terms and constraints of users to it and
solves it with any CVXPY solver. Canonicalisation makes it too slow for a control loop.
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
    position, velocity : (N+1, m, d) expressions [m], [m/s].
    force : (N, m, d) expression, the inputs [m/s^2].
    terms : convex terms of the objective; their sum is minimised.
    constraints : CVXPY constraints.
    """

    position: Any
    velocity: Any
    force: Any
    terms: list[Any]
    constraints: list[Any]

    @property
    def states(self) -> Any:
        """All positions, then all velocities, as a (2 (N+1) m d,) expression, in the order of `rows.Layout`."""
        return cp.hstack([cp.vec(self.position, order="C"), cp.vec(self.velocity, order="C")])

    def problem(self) -> Any:
        """Return the CVXPY problem, appended terms and constraints included."""
        return cp.Problem(cp.Minimize(sum(self.terms)), self.constraints)

    def solve(self, solver: str = "CLARABEL", **options: Any) -> float:
        """Solve and return the optimal value."""
        return float(self.problem().solve(solver=solver, canon_backend=cp.SCIPY_CANON_BACKEND, **options))


def build_cvxpy_subproblem(
    ocp: OCP, settings: Settings, required: Requirements, x: FloatArray, radius: float
) -> CvxpySubproblem:
    """Return the convex subproblem around the decision vector `x`; arguments as in `subproblem.build_subproblem`."""
    found = build_cvxpy_motion(ocp, settings, required, x, radius)
    _add_coverage(found, ocp, settings, ocp.motion(x), radius)
    _add_passive_safety(found, ocp, settings, ocp.motion(x), radius)
    return found


def build_cvxpy_motion(
    ocp: OCP, settings: Settings, required: Requirements, x: FloatArray, radius: float
) -> CvxpySubproblem:
    """Return the subproblem without coverage and passive safety: the motion nearest to `x` that the rest allows.

    `radius` may be infinite: then all that is not elastic holds of a motion, however far from `x`, or of none.
    """
    bar_q, bar_v = ocp.motion(x)
    shape, step = bar_q.shape, ocp.period
    position, velocity = cp.Variable(shape, name="position"), cp.Variable(shape, name="velocity")
    force = cp.Variable((ocp.steps, *shape[1:]), name="input")
    found = CvxpySubproblem(position, velocity, force, [], [])
    found.constraints += [
        position[1:] == position[:-1] + step * velocity[:-1] + 0.5 * step**2 * force,
        velocity[1:] == velocity[:-1] + step * force,
    ]
    _add_limits(found, ocp, settings, bar_v)
    _add_bounds(found, ocp, (bar_q, bar_v), radius)
    _add_pairs(found, ocp, settings, required, (bar_q, bar_v), radius)
    change = cp.sum_squares(position - bar_q) + cp.sum_squares(velocity - bar_v)
    found.terms.append(0.5 * settings.proximal * change)
    return found


def _add_limits(found: CvxpySubproblem, ocp: OCP, settings: Settings, bar_v: FloatArray) -> None:
    """Add speed and input limits (4.13, 4.14), as polytopes inscribed in their discs or as cones."""
    facets = inscribed(ocp.fleet.dimension, settings.sides)
    share = settings.margins.limit_share * (1.0 if settings.exact_cones else facets.shrink)
    for bar, now, limit in (
        (bar_v[ocp.first :], found.velocity[ocp.first :], share * ocp.fleet.speed_max),
        (np.diff(bar_v, axis=0), found.force, share * ocp.fleet.input_max),
    ):
        flat = cp.reshape(now, (bar.shape[0] * bar.shape[1], bar.shape[2]), order="C")  # a row for sample and agent
        most = np.tile(limit, bar.shape[0])
        if settings.exact_cones:
            found.constraints.append(cp.norm(flat, 2, axis=1) <= most)
            continue
        normals = turned_normals(facets, bar.reshape(flat.shape))  # (samples * agents, sides, d)
        across = sp.block_diag(list(normals), format="csr") @ cp.vec(flat, order="C")
        found.constraints.append(cp.abs(across) <= np.repeat(most, normals.shape[1]))


def _add_bounds(found: CvxpySubproblem, ocp: OCP, motion: tuple[FloatArray, FloatArray], radius: float) -> None:
    """Add the motion box (4.15, 4.16), the trust region and the boundary conditions (4.17)."""
    bar_q, bar_v = motion
    fleet, ends = ocp.fleet, ocp.ends
    between = (fleet.input_max * ocp.period**2 / 8.0)[:, None]  # deviation of a path from its chord
    if has_long_steps(fleet, ocp.period):
        between = 0.0 * between
        here = bar_q[:-1] + 0.5 * ocp.period * bar_v[:-1]
        control = found.position[:-1] + 0.5 * ocp.period * found.velocity[:-1]
        found.constraints += [
            control >= np.minimum(fleet.motion_min, here),
            control <= np.maximum(fleet.motion_max, here),
        ]
    given = {0: ends.start_position, ocp.steps: ends.end_position}
    free = [n for n in range(ocp.steps + 1) if given.get(n) is None]
    lower = np.maximum(bar_q - radius, np.minimum(fleet.motion_min + between, bar_q))
    upper = np.minimum(bar_q + radius, np.maximum(fleet.motion_max - between, bar_q))
    if free:
        inside = slice(free[0], free[-1] + 1)
        found.constraints += [found.position[inside] >= lower[inside], found.position[inside] <= upper[inside]]
    found.constraints += [found.position[n] == here for n, here in given.items() if here is not None]
    for i in fleet.lost:
        found.constraints.append(found.position[:, i] == np.tile(bar_q[0, i], (ocp.steps + 1, 1)))
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
    moved = cp.vec(found.position - bar_q, order="C")
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
    moved = found.states - np.concatenate([part.ravel() for part in motion])
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
            found.terms.append(settings.penalty * cp.pos(cp.norm(found.position[n, i] - found.position[n, j]) - bound))
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
    states = found.states
    normal = sp.csr_array((rows.value, (rows.row, rows.column)), shape=(rows.count, states.size))
    slack = cp.Variable(rows.slacks, nonneg=True)
    found.constraints.append(normal @ states - slack[rows.elastic] <= rows.upper)
    found.terms.append(penalty * cp.sum(slack))
