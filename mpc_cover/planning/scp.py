"""Sequential convex programming (SCP) with continuation: from a soft minimum towards the hard one.

Each stage is a majorise-minimise iteration by `solvers.sqp` at one sharpness of the soft minimum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from mpc_cover.constraints.passive_safety import braking_violation
from mpc_cover.coverage.majoriser import SAMPLES_PER_TERM, Softness
from mpc_cover.coverage.objective import coverage_cost
from mpc_cover.planning import interior_point
from mpc_cover.planning.coverage_nlp import CoverageNLP
from mpc_cover.planning.ocp import Settings
from solvers import sqp
from solvers.backends.base import Options as QPOptions
from solvers.globalization import Backtracking, TrustRegion
from solvers.native import library as native
from solvers.outcome import Outcome, Result

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import FloatArray
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.ocp import OCP
    from solvers.backends.base import Backend

FEASIBILITY = 2e-4
"""Violation up to which a motion counts as feasible [m, m/s, m/s^2]; a plain choice that `ocp.Margins` absorb."""

SHARPNESS = (4.0, 10.0, 30.0, 100.0)
"""beta times the sensing radius, by stage; finer stages and softer first ones took longer and covered less."""

SOFT_SHARPNESS = (1.0, 2.0, *SHARPNESS)
"""The stages of descents by the library, which take little time: from rest only so soft a minimum spreads the fleet
over all that it owes, as observed."""

MARGIN = 0.7
"""Sensing margin times beta; derived from log 2, by which two equally near samples lower the soft minimum."""

REFINEMENT_REGION = 0.5
"""First trust radius of refinements of good motions, in sensing radii; a plain choice."""

_FIRST_REGION, _REGION_MIN, _REGION_MAX = 1.0, 0.01, 2.0
"""First, smallest and largest trust radius of a stage, in sensing radii; plain choices."""
_SHRINK, _GROW = 0.4, 1.5
"""Factors of the trust radius after poor and good steps; plain choices, gentler than Nocedal and Wright's 1/4 and 2."""
_MAX_ITERATIONS = 10
"""QPs per stage; a plain choice."""
_OPTIMALITY = 3e-3
"""Relative predicted decrease below which a stage has converged; a plain choice, as the next stage changes J_beta."""
_STEP_MIN = 1e-5
"""Step length below which a stage ends [m]; a plain choice."""
_BACKTRACKS = 2
"""Halvings of a rejected step before the trust region shrinks; a plain choice."""
_SHARP = 30.0
"""Sharpness from which on QPs are solved to the back-end's fine tolerance, before to its inexact one. Plain choice: the
roll-out is exact and the merit function decides about steps, so that early QPs need not be accurate."""

_HARD = 300.0
"""Sharpness of the final stage without sensing margin; a plain choice."""
_FINAL_ITERATIONS = 12
"""QPs of the final stage; a plain choice."""
_FINAL_REGION, _FINAL_REGION_MIN, _FINAL_REGION_MAX = 0.1, 1e-6, 1.0
"""First, smallest and largest trust radius of the final stage, in sensing radii; plain choices."""
_FINAL_TOLERANCE = 1e-12
"""Relative predicted decrease and step length [m] below which the final stage ends; a plain choice, so small that only
the number of QPs bounds the stage."""

_NEWTON_STEPS = 8
"""Newton steps of an interior-point descent that take the place of one QP; about as long as one, as measured."""
_OUTCOMES = {
    native.Outcome.COMPLETE: Outcome.CONVERGED,
    native.Outcome.CONVERGED: Outcome.CONVERGED,
    native.Outcome.MAX_ITERATIONS: Outcome.MAX_ITERATIONS,
    native.Outcome.DEADLINE: Outcome.DEADLINE,
    native.Outcome.NUMERICAL: Outcome.SUBPROBLEM_FAILED,
    native.Outcome.OUT_OF_MEMORY: Outcome.SUBPROBLEM_FAILED,
}

BRAKING_TOLERANCE = 0.01
"""Tolerated violation of passive safety [m]; a plain choice within the margin of `constraints.passive_safety`."""
_BRAKING_VIOLATION_COST = 5.0
"""Cost of a metre of braking violation in the merit of a motion, in cells; a plain choice."""


@dataclass(frozen=True, eq=False)
class SCPResult:
    """The result of an SCP run.

    Attributes
    ----------
    x : decision vector of the best motion.
    cost : its exact J (4.34) [m].
    violation : largest violation of the requirements, margins included [m, m/s, m/s^2].
    stages : the SQP's result for each stage.
    braking_violation : largest violation of passive safety [m].
    """

    x: FloatArray
    cost: float
    violation: float
    stages: tuple[Result, ...]
    braking_violation: float = 0.0

    @property
    def feasible(self) -> bool:
        """Whether the motion satisfies the requirements within `FEASIBILITY`."""
        return self.violation <= FEASIBILITY

    @property
    def complete(self) -> bool:
        """Whether the motion is feasible, covers the whole demand, and is passively safe."""
        return self.feasible and self.cost == 0.0 and self.braking_violation <= BRAKING_TOLERANCE

    @property
    def merit(self) -> float:
        """J plus the cost of braking violations [m]."""
        return merit(self.cost, self.braking_violation)


def merit(cost: float, braking_violation: float) -> float:
    """Return the merit of a motion [m], lower is better: J [m] plus the cost of its braking violation [m]."""
    return cost + _BRAKING_VIOLATION_COST * max(braking_violation - BRAKING_TOLERANCE, 0.0)


def softness_at(sharpness: float, radius: float, margin: float = MARGIN, count: int = SAMPLES_PER_TERM) -> Softness:
    """Return the soft minimum of a stage, over `count` samples; `radius` [m] is the length scale.

    The sensing margin, `margin` over beta, compensates for the soft minimum lying below the hard one.
    """
    return Softness(beta=sharpness / radius, margin=margin / sharpness * radius, count=count)


def length_scale(ocp: OCP) -> float:
    """Return the smallest sensing radius of the fleet [m]."""
    return ocp.fleet.sensing_radius_min


def descends_natively(ocp: OCP, backend: Backend, *, exact_cones: bool = False) -> bool:
    """Return whether the library's interior point takes the place of the SQP on this OCP."""
    return backend.capabilities.whole_problem and not exact_cones and interior_point.supports(ocp)


def optimise(
    ocp: OCP,
    x: FloatArray,
    backend: Backend,
    *,
    sharpness: Sequence[float] = SHARPNESS,
    iterations: int = _MAX_ITERATIONS,
    region: float = _FIRST_REGION,
    budget: Budget,
    exact_cones: bool = False,
    margin: float = MARGIN,
    count: int = SAMPLES_PER_TERM,
) -> SCPResult:
    """Decrease J from the decision vector `x`, stage by stage; anytime: the best feasible motion is returned.

    `iterations` bounds the QPs of a stage; `margin` is the sensing margin times beta; soft minima are over `count`
    samples; `region` is the first trust radius in sensing radii; `exact_cones` needs a back-end that has them.
    Ends early once a motion is complete, or the budget is exhausted.
    """
    scale = length_scale(ocp)
    if descends_natively(ocp, backend, exact_cones=exact_cones):
        return _descended(ocp, x, sharpness, iterations, region, budget, margin, count)
    options = sqp.Options(
        max_iterations=iterations,
        optimality=_OPTIMALITY,
        feasibility=FEASIBILITY,
        smallest_step=_STEP_MIN,
        region=_trust_region(scale, region, _REGION_MIN, _REGION_MAX),
        line_search=Backtracking(most=_BACKTRACKS),
    )
    best = evaluate(ocp, x)
    metered, able = budget.metered(backend), backend.capabilities
    current, stages = x, []
    for value in sharpness:
        if best.complete or budget.exhausted:
            break
        softness = softness_at(value, scale, margin=margin, count=count)
        problem = CoverageNLP(ocp, Settings(softness, exact_cones=exact_cones))
        staged = replace(options, qp=QPOptions(able.fine if value >= _SHARP else able.inexact))
        result = sqp.solve(problem, current, metered, staged, clock=budget.clock, deadline=budget.deadline)
        stages.append(result)
        current = result.x
        found = evaluate(ocp, current)
        if is_better(found, best):
            best = found
    return replace(best, stages=tuple(stages))


def _descended(
    ocp: OCP,
    x: FloatArray,
    sharpness: Sequence[float],
    iterations: int,
    region: float,
    budget: Budget,
    margin: float,
    count: int,
) -> SCPResult:
    """Return the better of a motion and the best of an interior-point descent from it; arguments as in `optimise`."""
    best = evaluate(ocp, x)
    if best.complete or budget.exhausted:
        return best
    descent = interior_point.descend(
        ocp,
        x,
        sharpness,
        scale=length_scale(ocp),
        margin=margin,
        count=count,
        iterations=_NEWTON_STEPS * iterations * len(sharpness),
        region=region,
        judgement=interior_point.Judgement(FEASIBILITY, BRAKING_TOLERANCE, _BRAKING_VIOLATION_COST),
        budget=budget,
    )
    found = evaluate(ocp, descent.x)
    if ocp.on_iterate is not None:
        ocp.on_iterate(descent.x)
    stage = Result(descent.x, found.cost, found.violation, _OUTCOMES[descent.outcome], descent.iterations, ())
    return replace(found if is_better(found, best) else best, stages=(stage,))


def optimise_without_margin(
    ocp: OCP, best: SCPResult, backend: Backend, *, budget: Budget, exact_cones: bool = False
) -> SCPResult:
    """Return the better of a motion and its refinement without sensing margin, by accurate QPs.

    For motions that leave next to nothing: the margins that compensate for soft minima exclude tight solutions, such as
    one straight path that measures cells exactly two radii apart.
    """
    if budget.exhausted:
        return best
    scale = length_scale(ocp)
    if descends_natively(ocp, backend, exact_cones=exact_cones):
        final = _descended(ocp, best.x, (_HARD,), _FINAL_ITERATIONS, _FINAL_REGION, budget, 0.0, SAMPLES_PER_TERM)
        return replace(final if is_better(final, best) else best, stages=(*best.stages, *final.stages))
    settings = Settings(softness_at(_HARD, scale, margin=0.0), exact_cones=exact_cones)
    options = sqp.Options(
        max_iterations=_FINAL_ITERATIONS,
        optimality=_FINAL_TOLERANCE,
        feasibility=FEASIBILITY,
        smallest_step=_FINAL_TOLERANCE,
        region=_trust_region(scale, _FINAL_REGION, _FINAL_REGION_MIN, _FINAL_REGION_MAX),
        line_search=Backtracking(most=_BACKTRACKS),
        qp=QPOptions(tolerance=backend.capabilities.accurate),
    )
    result = sqp.solve(
        CoverageNLP(ocp, settings),
        best.x,
        budget.metered(backend),
        options,
        clock=budget.clock,
        deadline=budget.deadline,
    )
    found = evaluate(ocp, result.x)
    return replace(found if is_better(found, best) else best, stages=(*best.stages, result))


def _trust_region(scale: float, first: float, smallest: float, largest: float) -> TrustRegion:
    """Return a trust region whose radii are given in units of `scale` [m]."""
    return TrustRegion(first * scale, smallest=smallest * scale, largest=largest * scale, shrink=_SHRINK, grow=_GROW)


def evaluate(ocp: OCP, x: FloatArray) -> SCPResult:
    """Return the evaluation of a decision vector without any refinement."""
    if (known := interior_point.evaluate(ocp, x)) is not None:
        return SCPResult(x, known.cost, known.violation, (), known.braking_violation)
    return evaluate_with_numpy(ocp, x)


def evaluate_with_numpy(ocp: OCP, x: FloatArray) -> SCPResult:
    """Return the evaluation of a decision vector where the library was not built; the two agree up to rounding."""
    problem = CoverageNLP(ocp, Settings(softness_at(SHARPNESS[-1], length_scale(ocp))))
    position, velocity = ocp.motion(x)
    cost = coverage_cost(position, ocp.cell, ocp.fleet.radius, ocp.weight, ocp.looks, ocp.between(velocity))
    braking = braking_violation(position, velocity, ocp.period, ocp.fleet)
    return SCPResult(x, cost, problem.violation(x), (), braking)


def is_better(new: SCPResult, old: SCPResult) -> bool:
    """Return whether `new` is better: feasible first, then lower merit; among infeasible ones, lower violation."""
    if new.feasible != old.feasible:
        return new.feasible
    return new.merit < old.merit if new.feasible else new.violation < old.violation
