"""The interior-point descent of `solvers.native` on an OCP: one Newton step per linearisation of the whole problem.

Where the SQP solves a QP for each linearisation, this takes a single step of an interior point on it, with the convex
majoriser's Hessian, exact discs instead of polygons, and slacks and dynamics eliminated. The soft minimum sharpens
stage by stage, as in `scp`. Lengths are those of the OCP; the library counts times in steps.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from mpc_cover.constraints.control_points import has_long_steps
from mpc_cover.constraints.pairs import all_pairs, linked_pairs
from mpc_cover.constraints.passive_safety import braking_separations, stop_instants
from mpc_cover.model.motion import chord_deviation
from mpc_cover.model.sensing import TIE
from mpc_cover.planning.ocp import Margins, requirements
from solvers.native import library as native

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.ocp import OCP

_VARIABLES_MAX, _OWN_VARIABLES_MAX = 15_000, 600
"""Variables of a fleet, and of each agent, up to which a descent takes less time than segments of the motion, one after
the other; an agent's are factorised at once. Plain choices; larger OCPs are left to the SQP."""
_DENSE_MAX = 420
"""Variables up to which the whole fleet is factorised at once; plain choice."""
_STAGE_STEPS = 15
"""Newton steps after which a stage ends anyway; a plain choice that few stages reach."""
_STEPS_MAX = 200
"""Newton steps of a descent; a plain choice, which descents of the thesis' cases reach when they do not converge."""
_OVERSHOOT = (0.5, 0.2, 0.1)
"""Parts of their limits by which speeds and inputs may exceed them during a descent: at soft, sharper and sharp minima.
Steps that never leave the discs are short where many are active. Plain choices by J after descents of box-3."""
_SOFT, _SHARP = 20.0, 50.0
"""Sharpness up to which minima count as soft, and from which on as sharp; plain choices."""
_PENALTY = 50.0
"""Weight of the l1 penalty, as in `ocp.Settings`."""
_PROXIMAL = 1e-4
"""Weight of squared displacements, as in `ocp.Settings`."""
_BARRIER, _BARRIER_MIN = 0.1, 1e-5
"""First and least barrier parameter, in radii; plain choices by J after descents of box-3."""
_SMALL_STEP = 0.05
"""Displacement in radii below which a stage has converged; a plain choice, as the next stage changes J_beta."""
_INSIDE = 1e-6
"""How far inside a sensing disc a cell must lie for a descent to count it, in radii, but for the last one without
sensing margin: what is covered by less than rounding in other coordinates is not covered there. Plain choice."""
_LEAST_ROOM = 0.01
"""First slack of a limit that a guess exceeds, as a part of it; a plain choice."""
_NEAREST_S, _TERM_S, _CONDENSE_S, _FACTOR_S = 2.2e-9, 3.5e-7, 1.6e-9, 2.6e-11
"""Seconds of a Newton step: per pair of cell and sample, per term, per entry of the Hessian, and per cubed variable.
From instructions counted on box-3, at 2.5 of them a cycle of 0.4 ns."""
_BETWEEN = 4.0
"""Factor of the first where looks count between samples: most intervals are too far away to matter. Measured."""
_COUPLED = (1.0, 3.0)
"""Factors of the last two where the fleet is one block, and where agents are blocks that conjugate gradients couple; as
measured with 24 agents."""


class Judgement(NamedTuple):
    """What makes a motion good, as the caller judges it: tolerances, and the cost of a braking violation."""

    feasibility: float
    braking_tolerance: float
    braking_cost: float


class Descent(NamedTuple):
    """The best decision vector of a descent, its Newton steps, and why it ended."""

    x: FloatArray
    iterations: int
    outcome: native.Outcome


def supports(ocp: OCP) -> bool:
    """Return whether the library was built, and the OCP is not too large for it."""
    own = (ocp.steps + 2) * ocp.fleet.dimension
    return own <= _OWN_VARIABLES_MAX and own * ocp.fleet.size <= _VARIABLES_MAX and native.library() is not None


def descend(
    ocp: OCP,
    x: FloatArray,
    sharpness: Sequence[float],
    *,
    scale: float,
    margin: float,
    count: int,
    iterations: int,
    region: float,
    judgement: Judgement,
    budget: Budget,
) -> Descent:
    """Decrease J from a decision vector, and return the best motion on the way, by exact cost and violations.

    `scale` is the smallest sensing radius, the unit of `region`, the largest displacement of a step; `sharpness` and
    `margin` are as in `scp.optimise`; soft minima are over `count` samples. Deterministic where the budget counts work.
    """
    problem, each_s = _problem(ocp), _step_s(ocp, count)
    steps = min(iterations, _STEPS_MAX)
    if budget.counts and budget.deadline is not None:
        steps = min(steps, max(1, int(budget.left_s / each_s)))
    options = native.Options(
        stages=len(sharpness),
        iterations=steps,
        stage_iterations=_STAGE_STEPS,
        samples=count,
        sharpness=np.asarray(sharpness) / scale,
        floor=np.full(len(sharpness), _BARRIER_MIN * scale),
        overshoot=[_overshoot(value) for value in sharpness],
        margin=margin,
        penalty=_PENALTY,
        proximal=_PROXIMAL / scale,
        barrier=_BARRIER * scale,
        step_max=region * scale,
        small_step=_SMALL_STEP * scale,
        least_room=_LEAST_ROOM * scale,
        feasibility=judgement.feasibility,
        limit_feasibility=judgement.feasibility * ocp.period,
        input_feasibility=judgement.feasibility * ocp.period**2,
        braking_tolerance=judgement.braking_tolerance,
        braking_cost=judgement.braking_cost / _mean_weight(ocp),
        tie=-_INSIDE * scale if margin > 0.0 else TIE,
        deadline_s=math.inf if budget.counts or budget.deadline is None else max(budget.left_s, 0.0),
        potrf=native.lapack("dpotrf"),
        potrs=native.lapack("dpotrs"),
    )
    size = ocp.fleet.start.size
    found, known = native.descend(problem, options, np.concatenate([x[:size], ocp.period * x[size:]]))
    budget.charge(each_s * known.iterations)
    best = np.concatenate([found[:size], found[size:] / ocp.period])
    return Descent(ocp.exact_ends(best), known.iterations, native.Outcome(known.outcome))


class Evaluation(NamedTuple):
    """J, the largest violation of the requirements, and that of passive safety, of a motion; see `scp.evaluate`."""

    cost: float
    violation: float
    braking_violation: float


def evaluate(ocp: OCP, x: FloatArray) -> Evaluation | None:
    """Return the evaluation of a decision vector, or None where the library was not built."""
    if native.library() is None:
        return None
    size = ocp.fleet.start.size
    options = native.Options(
        stages=1,
        samples=1,
        sharpness=[1.0],
        floor=[1.0],
        overshoot=[0.0],
        feasibility=1.0,
        limit_feasibility=ocp.period,
        input_feasibility=ocp.period**2,
        tie=TIE,
    )
    found = native.evaluate(_problem(ocp), options, np.concatenate([x[:size], ocp.period * x[size:]]))
    return Evaluation(found.cost * _mean_weight(ocp), found.violation, found.braking)


def _problem(ocp: OCP) -> native.Problem:
    """Return the OCP as the library takes it, made once."""
    known = _PROBLEMS.get(ocp)
    if known is None:
        known = _PROBLEMS[ocp] = problem_of(ocp, Margins())
    return known


_PROBLEMS: WeakKeyDictionary[OCP, native.Problem] = WeakKeyDictionary()
"""OCPs in use, as the library takes them."""


def problem_of(ocp: OCP, margins: Margins) -> native.Problem:
    """Return an OCP as the library takes it: lengths as they are, times in steps."""
    fleet, ends, step = ocp.fleet, ocp.ends, ocp.period
    agents, dimension = fleet.start.shape
    required = requirements(ocp, margins)
    one, two = all_pairs(agents)
    low, high = _box(ocp)
    links = np.zeros(one.size, dtype=np.uint8)
    links[linked_pairs(agents, fleet.links)] = 1
    apart = fleet.separation_min > 0.0
    stops = stop_instants(fleet.reaction_periods)
    magnitude, cell, looks = _demand(ocp)
    weight = ocp.weight[magnitude, cell] / _mean_weight(ocp)
    parts, continuous = _looks_between(ocp)
    bow = chord_deviation(fleet.input_max[one] + fleet.input_max[two], step)
    return native.Problem(
        steps=ocp.steps,
        agents=agents,
        dimension=dimension,
        pairs=one.size,
        first=ocp.first,
        closed=ends.closed,
        end_fixed=ends.closed or ends.end_position is not None,
        long_steps=has_long_steps(fleet, step),
        linked=agents > 1 and bool(np.isfinite(fleet.communication_range)),
        instants=len(stops),
        dense_max=_DENSE_MAX,
        demands=cell.size,
        parts=parts,
        continuous=continuous,
        range=required.range,
        speed_max=margins.limit_share * step * fleet.speed_max,
        input_max=margins.limit_share * step**2 * fleet.input_max,
        speed_limit=(1.0 - margins.limits) * step * fleet.speed_max,
        input_limit=(1.0 - margins.limits) * step**2 * fleet.input_max,
        braking_input=step**2 * fleet.input_max,
        active=fleet.is_active,
        box_low=low,
        box_high=high,
        box_aside=chord_deviation(fleet.input_max, step),
        separation=required.separation if apart else np.zeros(one.size),
        braking_separation=braking_separations(fleet) if apart else np.zeros(one.size),
        pair_aside=bow,
        link=links,
        cell=ocp.cell,
        radius=fleet.radius.T,
        demand_cell=cell,
        demand_magnitude=magnitude,
        demand_looks=looks,
        demand_weight=weight,
        lag=[stop.lag for stop in stops],
        lag_part=[stop.part for stop in stops],
        fixed=_fixed(ocp),
    )


def _box(ocp: OCP) -> tuple[FloatArray, FloatArray]:
    """Return the walls (m, d), relaxed to a given start outside them."""
    low, high = (np.broadcast_to(wall, ocp.fleet.start.shape) for wall in (ocp.fleet.motion_min, ocp.fleet.motion_max))
    if (start := ocp.ends.start_position) is None:
        return low, high
    return np.minimum(low, start.min(axis=0)), np.maximum(high, start.max(axis=0))


def _demand(ocp: OCP) -> tuple[IntArray, IntArray, IntArray]:
    """Return magnitudes, cells and looks of the demand, cell by cell."""
    cell, magnitude = np.nonzero(ocp.weight.T > 0.0)
    looks = np.ones(cell.size, dtype=np.intp) if ocp.looks is None else ocp.looks[magnitude, cell]
    return magnitude, cell, looks


def _looks_between(ocp: OCP) -> tuple[int, bool]:
    """Return the looks of an interval, or the points its nearest is found from, and whether every point counts."""
    between = ocp.between(np.zeros((ocp.steps + 1, *ocp.fleet.start.shape)))
    if between is None:
        return 1, False
    if not between.instants.continuous:
        return between.instants.per_step, False
    fastest = np.full((1, 1, 1), ocp.fleet.speed_max.max())
    finite = ocp.fleet.radius[np.isfinite(ocp.fleet.radius)]
    return type(between)(fastest, ocp.period, between.instants).parts(float(finite.min())).size, True


def _fixed(ocp: OCP) -> FloatArray:
    """Return which variables (N+2, m, d) are given: positions at sample 0, then velocities at each sample."""
    fixed, ends = np.zeros((ocp.steps + 2, *ocp.fleet.start.shape), dtype=np.uint8), ocp.ends
    fixed[0] = ends.start_position is not None
    fixed[1] = ends.start_velocity is not None
    fixed[-1] |= np.uint8(ends.end_velocity is not None)
    fixed[:, list(ocp.fleet.lost)] = 1
    return fixed


def _mean_weight(ocp: OCP) -> float:
    owed = ocp.weight[ocp.weight > 0.0]
    return float(owed.mean()) if owed.size else 1.0


def _overshoot(sharpness: float) -> float:
    return _OVERSHOOT[int(sharpness >= _SOFT) + int(sharpness >= _SHARP)]


def _step_s(ocp: OCP, count: int) -> float:
    """Return the time of a Newton step [s] as it is charged where work is counted."""
    looks = 1 if ocp.looks is None else max(1, int(ocp.looks.max(initial=1)))
    terms = looks * np.count_nonzero(ocp.weight > 0.0)
    variables, blocks = (ocp.steps + 2) * ocp.fleet.start.size, 1
    if variables > _DENSE_MAX:
        variables, blocks = variables // ocp.fleet.size, ocp.fleet.size
    parts, continuous = _looks_between(ocp)
    nearest = terms / looks * (ocp.steps + 1) * ocp.fleet.size * (_BETWEEN if parts > 1 or continuous else 1.0)
    per_term = _TERM_S * (count * ocp.fleet.dimension / 12.0) ** 2
    dense = _CONDENSE_S * variables**2 + _FACTOR_S * variables**3
    return float(_NEAREST_S * nearest + per_term * terms + _COUPLED[blocks > 1] * blocks * dense)
