"""Majorise-minimise with continuation: from a soft minimum to the hard one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.passive_safety import braking_violation
from mpc_cover.coverage.majoriser import Softness
from mpc_cover.coverage.objective import coverage_cost
from mpc_cover.planning.coverage_nlp import CoverageNLP
from mpc_cover.planning.ocp import Settings
from solvers import sqp
from solvers.backends.base import Options as QPOptions
from solvers.globalization import Backtracking, TrustRegion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import FloatArray
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.ocp import OCP
    from solvers.backends.base import Backend
    from solvers.outcome import Result

FEASIBILITY = 2e-4
"""Violation [m, m/s, m/s^2] that margins absorb many times over."""

SHARPNESS = (4.0, 10.0, 30.0, 100.0)
"""beta times the sensing radius, stage by stage; finer steps and softer beginnings took longer and covered less."""

MARGIN = 0.7
"""Sensing margin times beta; log 2 is what two equally near samples take off the minimum."""

_SHARP = 30.0
"""From this sharpness on QPs are solved to the fine tolerance of the back-end, before to the inexact one.

An inexact QP inside the SQP costs little: the roll-out is exact and the merit judges the step."""

_HARD = 300.0
"""Sharpness with which the last of all is settled, by accurate QPs."""


BRAKING_TOLERANCE = 0.01
"""Exposure [m] that the spare room of `constraints.passive_safety` covers."""
_BRAKING_VIOLATION_COST = 5.0
"""What a metre of braking violation costs, in cells times metres, where motions are compared."""


@dataclass(frozen=True, eq=False)
class SCPResult:
    """What a continuation ends with.

    Attributes
    ----------
    x : decision vector of the best motion.
    cost : its J, exactly (4.34) [m].
    violation : worst violation of the requirements, margins included.
    stages : the SQP's result for each stage.
    braking_violation : worst violation of passive safety or of the box, should anyone brake without warning [m].
    """

    x: FloatArray
    cost: float
    violation: float
    stages: tuple[Result, ...]
    braking_violation: float = 0.0

    @property
    def feasible(self) -> bool:
        """Whether the motion satisfies the requirements."""
        return self.violation <= FEASIBILITY

    @property
    def complete(self) -> bool:
        """Whether everything is covered, feasibly, and with room to stop."""
        return self.feasible and self.cost == 0.0 and self.braking_violation <= BRAKING_TOLERANCE

    @property
    def merit(self) -> float:
        """J and what braking violations are worth [m]."""
        return merit(self.cost, self.braking_violation)


def merit(cost: float, braking_violation: float) -> float:
    """Return what a motion of cost J [m] and a braking violation [m] is worth, where motions are compared [m]."""
    return cost + _BRAKING_VIOLATION_COST * max(braking_violation - BRAKING_TOLERANCE, 0.0)


def softness_at(sharpness: float, radius: float, margin: float = MARGIN, count: int = 6) -> Softness:
    """Return the soft minimum of a stage, over `count` samples; `radius` [m] sets the length scale.

    The sensing margin, `margin` over beta, makes up for what the soft minimum lies below the hard one.
    """
    return Softness(beta=sharpness / radius, margin=margin / sharpness * radius, count=count)


def length_scale(ocp: OCP) -> float:
    """Return the smallest sensing radius of the fleet [m]."""
    radius = ocp.fleet.radius
    return float(radius[np.isfinite(radius)].min())


def optimise(
    ocp: OCP,
    x: FloatArray,
    backend: Backend,
    *,
    sharpness: Sequence[float] = SHARPNESS,
    iterations: int = 10,
    region: float = 1.0,
    budget: Budget,
    exact_cones: bool = False,
    margin: float = MARGIN,
    count: int = 6,
) -> SCPResult:
    """Lower J from the decision vector `x`, stage by stage; anytime: the best feasible motion is returned.

    `iterations` bounds the QPs of a stage; `margin` is the sensing margin times beta; soft minima are over `count`
    samples; `region` is the first trust radius in sensing radii; `exact_cones` needs a back-end that has them.
    Ends early once everything is covered, or the budget is exhausted.
    """
    scale = length_scale(ocp)
    options = sqp.Options(
        max_iterations=iterations,
        optimality=3e-3,
        feasibility=FEASIBILITY,
        smallest_step=1e-5,
        region=TrustRegion(region * scale, smallest=0.01 * scale, largest=2.0 * scale, shrink=0.4, grow=1.5),
        line_search=Backtracking(most=2),
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


def optimise_without_margin(
    ocp: OCP, best: SCPResult, backend: Backend, *, budget: Budget, exact_cones: bool = False
) -> SCPResult:
    """Return the better of a motion and what becomes of it without any sensing margin, by accurate QPs.

    For motions that leave next to nothing: margins that make up for soft minima forbid what only just fits, as cells
    exactly two radii apart that one straight path measures.
    """
    if budget.exhausted:
        return best
    scale = length_scale(ocp)
    settings = Settings(softness_at(_HARD, scale, margin=0.0), exact_cones=exact_cones)
    options = sqp.Options(
        max_iterations=12,
        optimality=1e-12,
        feasibility=FEASIBILITY,
        smallest_step=1e-12,
        region=TrustRegion(0.1 * scale, smallest=1e-6 * scale, largest=scale, shrink=0.4, grow=1.5),
        line_search=Backtracking(most=2),
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


def evaluate(ocp: OCP, x: FloatArray) -> SCPResult:
    """Return what a decision vector is worth as it stands."""
    problem = CoverageNLP(ocp, Settings(softness_at(SHARPNESS[-1], length_scale(ocp))))
    position, velocity = ocp.motion(x)
    cost = coverage_cost(position, ocp.cell, ocp.fleet.radius, ocp.weight, ocp.looks)
    exposed = braking_violation(position, velocity, ocp.period, ocp.fleet)
    return SCPResult(x, cost, problem.violation(x), (), exposed)


def is_better(new: SCPResult, old: SCPResult) -> bool:
    """Whether `new` is the better motion: feasible before cheaper, and what is not feasible, the less so."""
    if new.feasible != old.feasible:
        return new.feasible
    return new.merit < old.merit if new.feasible else new.violation < old.violation
