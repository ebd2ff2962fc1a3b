"""Majorise-minimise with continuation: from a soft minimum to the hard one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.stopping import exposure
from mpc_cover.coverage.majoriser import Softness
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

SHARPNESS = (4.0, 10.0, 30.0, 100.0)
"""beta times the sensing radius, stage by stage; finer steps and softer beginnings took longer and covered less."""

MARGIN = 0.7
"""Sensing margin times beta; log 2 is what two equally near samples take off the minimum."""

_SHARP = 30.0
"""From this sharpness on QPs are solved to the finer of the tolerances."""
_LOOSE, _FINE = 1e-3, {"osqp": 1e-3, "clarabel": 1e-4, "piqp": 1e-4}
"""An inexact QP inside the SQP costs little: the roll-out is exact and the merit judges the step."""

_HARD, _ACCURATE = 300.0, {"osqp": 1e-5, "clarabel": 1e-9, "piqp": 1e-9}
"""Sharpness and tolerance with which the last of all is settled."""


EXPOSED = 0.01
"""Exposure [m] that the spare room of `constraints.stopping` covers."""
_EXPOSURE_COST = 5.0
"""What a metre of exposure costs, in cells times metres, where motions are compared."""


@dataclass(frozen=True, eq=False)
class Refined:
    """What a continuation ends with.

    Attributes
    ----------
    x : decision vector of the best motion.
    cost : its J, exactly (4.34) [m].
    violation : worst violation of the requirements, margins included.
    stages : the SQP's result for each stage.
    exposure : by how much someone comes too near to one who stops without warning, or that one leaves the box [m].
    """

    x: FloatArray
    cost: float
    violation: float
    stages: tuple[Result, ...]
    exposure: float = 0.0

    @property
    def feasible(self) -> bool:
        """Whether the motion satisfies the requirements."""
        return self.violation <= FEASIBILITY

    @property
    def complete(self) -> bool:
        """Whether everything is covered, feasibly, and with room to stop."""
        return self.feasible and self.cost == 0.0 and self.exposure <= EXPOSED

    @property
    def merit(self) -> float:
        """J and what exposure is worth [m]."""
        return merit(self.cost, self.exposure)


def merit(cost: float, exposure: float) -> float:
    """Return what a motion of cost J [m] and an exposure [m] is worth, where motions are compared [m]."""
    return cost + _EXPOSURE_COST * max(exposure - EXPOSED, 0.0)


def softness_at(sharpness: float, radius: float, margin: float = MARGIN, count: int = 6) -> Softness:
    """Return the soft minimum of a stage, over `count` samples; `radius` [m] sets the length scale.

    The sensing margin, `margin` over beta, makes up for what the soft minimum lies below the hard one.
    """
    return Softness(beta=sharpness / radius, margin=margin / sharpness * radius, count=count)


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
    margin: float = MARGIN,
    count: int = 6,
    fine: bool = False,
) -> Refined:
    """Lower J from the decision vector `x`, stage by stage; anytime: the best feasible motion is returned.

    `iterations` bounds the QPs of a stage; `margin` is the sensing margin times beta; soft minima are over `count`
    samples; `fine` asks for accurate QPs in all stages, not only the last; `region` is the first trust radius in
    sensing radii; `deadline` is on `time.perf_counter`; `exact_cones` needs a back-end that has them.
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
    )
    best = judge(window, x)
    current, stages = x, []
    for value in sharpness:
        if best.complete or late(deadline):
            break
        softness = softness_at(value, scale, margin=margin, count=count)
        problem = CoverageProblem(window, Settings(softness, exact_cones=exact_cones))
        tolerance = _FINE[backend.name] if fine or value >= _SHARP else _LOOSE
        staged = replace(options, qp=QPOptions(tolerance=tolerance))
        result = sqp.solve(problem, current, backend, staged, deadline=deadline)
        stages.append(result)
        current = result.x
        found = judge(window, current)
        if better(found, best):
            best = found
    return replace(best, stages=tuple(stages))


def settled(
    window: Window, best: Refined, backend: Backend, *, deadline: float | None = None, exact_cones: bool = False
) -> Refined:
    """Return the better of a motion and what becomes of it without any sensing margin, by accurate QPs.

    For motions that leave next to nothing: margins that make up for soft minima forbid what only just fits, as cells
    exactly two radii apart that one straight path measures.
    """
    if late(deadline):
        return best
    scale = length_scale(window)
    settings = Settings(softness_at(_HARD, scale, margin=0.0), exact_cones=exact_cones)
    options = sqp.Options(
        max_iterations=12,
        optimality=1e-12,
        feasibility=FEASIBILITY,
        smallest_step=1e-12,
        region=TrustRegion(0.1 * scale, smallest=1e-6 * scale, largest=scale, shrink=0.4, grow=1.5),
        line_search=Backtracking(most=2),
        qp=QPOptions(tolerance=_ACCURATE[backend.name]),
    )
    result = sqp.solve(CoverageProblem(window, settings), best.x, backend, options, deadline=deadline)
    found = judge(window, result.x)
    return replace(found if better(found, best) else best, stages=(*best.stages, result))


def judge(window: Window, x: FloatArray) -> Refined:
    """Return what a decision vector is worth as it stands."""
    problem = CoverageProblem(window, Settings(softness_at(SHARPNESS[-1], length_scale(window))))
    position, velocity = window.motion(x)
    cost = coverage_cost(position, window.cell, window.fleet.radius, window.weight, window.looks)
    exposed = exposure(position, velocity, window.period, window.fleet)
    return Refined(x, cost, problem.violation(x), (), exposed)


def better(new: Refined, old: Refined) -> bool:
    """Whether `new` is the better motion: feasible before cheaper, and what is not feasible, the less so."""
    if new.feasible != old.feasible:
        return new.feasible
    return new.merit < old.merit if new.feasible else new.violation < old.violation
