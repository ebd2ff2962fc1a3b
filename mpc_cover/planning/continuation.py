"""Majorise-minimise with continuation: from a soft minimum to the hard one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.coverage.majoriser import Softness
from mpc_cover.coverage.nearest import still_owed
from mpc_cover.coverage.objective import coverage_cost
from mpc_cover.planning.deadline import late
from mpc_cover.planning.problem import CoverageProblem
from mpc_cover.planning.window import Settings
from solvers import sqp
from solvers.backends.base import Options as QPOptions
from solvers.globalization import Backtracking, TrustRegion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import FloatArray
    from mpc_cover.planning.window import Window
    from solvers.backends.base import Backend
    from solvers.outcome import Result

FEASIBILITY = 2e-4
"""Violation [m, m/s, m/s^2] that margins absorb many times over."""

SHARPNESS = (1.0, 2.0, 4.0, 8.0, 12.0, 20.0, 40.0)
"""beta times the sensing radius, stage by stage."""

_KICKS, _KICK, _KICKED = 4, 4.0, (8.0, 20.0, 40.0)
"""What is uncovered weighs so much more, so many times, and the stages that follow."""
_WORTH_KICKING = 1.0
"""More than this many sensing radii of cost is no matter of a few cells."""
_TOLERANCE = {"osqp": 1e-3, "clarabel": 1e-5, "piqp": 1e-5}
"""An inexact QP inside the SQP costs little: the roll-out is exact and the merit judges the step."""


@dataclass(frozen=True, eq=False)
class Refined:
    """What a continuation ends with.

    Attributes
    ----------
    x : decision vector of the best motion.
    cost : its J, exactly (4.34) [m].
    violation : worst violation of the requirements, margins included.
    stages : the SQP's result for each stage.
    """

    x: FloatArray
    cost: float
    violation: float
    stages: tuple[Result, ...]

    @property
    def feasible(self) -> bool:
        """Whether the motion satisfies the requirements."""
        return self.violation <= FEASIBILITY


def softness_at(sharpness: float, radius: float, count: int = 6) -> Softness:
    """Return the soft minimum of a stage; `radius` [m] sets the length scale.

    The margin 0.7/beta makes up for what the soft minimum lies below the hard one.
    """
    return Softness(beta=sharpness / radius, margin=max(0.7 / sharpness, 0.02) * radius, count=count)


def length_scale(window: Window) -> float:
    """Return the smallest sensing radius of the fleet [m]."""
    radius = window.fleet.radius
    return float(radius[np.isfinite(radius)].min())


def refine(
    window: Window,
    x: FloatArray,
    backend: Backend,
    *,
    sharpness: Sequence[float] = SHARPNESS,
    iterations: int = 10,
    region: float = 1.0,
    deadline: float | None = None,
    exact_cones: bool = False,
    count: int = 6,
) -> Refined:
    """Lower J from the decision vector `x`, stage by stage; anytime: the best feasible motion is returned.

    `iterations` bounds the QPs of a stage, `count` the samples that a cell looks at; `region` is the first trust
    radius in sensing radii; `deadline` is on `time.perf_counter`; `exact_cones` needs a back-end that has them.
    Stops early once everything is covered.
    """
    scale = length_scale(window)
    options = sqp.Options(
        max_iterations=iterations,
        optimality=3e-3,
        feasibility=FEASIBILITY,
        smallest_step=1e-5,
        region=TrustRegion(region * scale, smallest=0.01 * scale, largest=2.0 * scale, shrink=0.4, grow=1.5),
        line_search=Backtracking(most=2),
        qp=QPOptions(tolerance=_TOLERANCE[backend.name]),
    )
    best = judge(window, x)
    current, stages = x, []
    for value in sharpness:
        if best.cost == 0.0 and best.feasible:
            break
        if late(deadline):
            break
        problem = CoverageProblem(window, Settings(softness_at(value, scale, count), exact_cones=exact_cones))
        result = sqp.solve(problem, current, backend, options, deadline=deadline)
        stages.append(result)
        current = result.x
        found = judge(window, current)
        if _better(found, best):
            best = found
    return Refined(best.x, best.cost, best.violation, tuple(stages))


def refine_thoroughly(
    window: Window,
    x: FloatArray,
    backend: Backend,
    *,
    deadline: float | None = None,
    exact_cones: bool = False,
) -> Refined:
    """Lower J from one start in several ways until everything is covered; the best is returned.

    First quickly from a rather sharp minimum, as good starts need no more; then from a very soft one that
    looks at more samples; then, from the best so far, with what is still uncovered weighing more.
    """
    refined = partial(refine, backend=backend, deadline=deadline, exact_cones=exact_cones)
    best = refined(window, x, sharpness=SHARPNESS[2:], iterations=6)
    stages = best.stages
    if best.cost > 0.0 or not best.feasible:
        again = refined(window, x, iterations=6, count=10)
        stages += again.stages
        best = again if _better(again, best) else best
    weight = window.weight
    for _ in range(_KICKS):
        if best.cost == 0.0 or best.cost > _WORTH_KICKING * length_scale(window) or not best.feasible:
            break
        position, _velocity = window.motion(best.x)
        left = still_owed(position, window.cell, window.fleet.radius, window.weight) > 0.0
        weight = np.where(left, _KICK * weight, weight)
        kicked = refined(replace(window, weight=weight), best.x, sharpness=_KICKED, iterations=5, region=0.5)
        stages += kicked.stages
        last = judge(window, kicked.stages[-1].x if kicked.stages else best.x)
        best = last if _better(last, best) else best
    return replace(best, stages=stages)


def judge(window: Window, x: FloatArray) -> Refined:
    """Return what a decision vector is worth as it stands."""
    problem = CoverageProblem(window, Settings(softness_at(SHARPNESS[-1], length_scale(window))))
    position, _ = window.motion(x)
    cost = coverage_cost(position, window.cell, window.fleet.radius, window.weight, window.looks)
    return Refined(x, cost, problem.measure(x).violation, ())


def _better(new: Refined, old: Refined) -> bool:
    if new.feasible != old.feasible:
        return new.feasible
    return new.cost < old.cost if new.feasible else new.violation < old.violation
