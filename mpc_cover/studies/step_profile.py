"""`mpc-cover bench step`: profiles the control steps of a flight in closed loop.

The functions of interest are timed from outside, for the duration of the flight: there is no timing code in the
planner. Times are exclusive: time that a timed function spends in another timed function counts there.
"""

from __future__ import annotations

import time
from collections import defaultdict
from contextlib import ExitStack
from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.control.receding_horizon import RecedingHorizon
from mpc_cover.information.build import make_map
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.planning.budget import Budget
from mpc_cover.studies.patching import patched

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.mission.load import Mission

PLACES = {
    "descents": ("solvers.native.library:descend",),
    "evaluation": ("solvers.native.library:evaluate",),
    "OCPs for the library": ("planning.interior_point:problem_of",),
    "nearest samples": ("coverage.majoriser:nearest_samples", "coverage.objective:nearest_samples"),
    "majoriser": ("planning.subproblem:build_majoriser", "planning.subproblem:coverage_terms"),
    "rows": ("planning.subproblem:motion_rows", "planning.subproblem:bound_rows", "planning.subproblem:pair_rows"),
    "stacking": ("planning.coverage_nlp:build_subproblem",),
    "QP set-up": ("solvers.backends.base:Backend.load",),
    "QP solve": ("solvers.backends.base:Backend.warm_start", "solvers.backends.base:Backend.solve"),
    "measuring": ("planning.coverage_nlp:CoverageNLP.measure", "planning.scp:coverage_cost"),
    "verification": (
        "control.constraint_relaxation:verify_motion",
        "control.constraint_relaxation:MotionBounds.keeps_mixed",
    ),
    "plans held": ("control.planning_constraints:crossing",),
    "attainable bounds": ("control.planning_constraints:PlanningConstraints.update",),
    "splicing": (
        "control.plan_improvement:spliced",
        "control.receding_horizon:best_proposal",
        "control.demand_allocation:DemandAllocation.left",
    ),
}
"""The timed functions by the names of parts: "module:attribute", modules within mpc_cover unless of the solvers."""

_LONGEST = 2000
"""Largest number of steps, for a flight that does not finish."""


class Stopwatch:
    """Exclusive times by name [s]."""

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self.spent: dict[str, float] = defaultdict(float)
        self._clock = clock
        self._inner: list[float] = []

    def timed(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return `function`, timed under `name`."""

        def wrapper(*arguments: Any, **options: Any) -> Any:
            begun = self._clock()
            self._inner.append(0.0)
            try:
                return function(*arguments, **options)
            finally:
                total = self._clock() - begun
                self.spent[name] += total - self._inner.pop()
                if self._inner:
                    self._inner[-1] += total

        return wrapper

    def reset(self) -> dict[str, float]:
        """Return the times by name, and reset them."""
        spent, self.spent = dict(self.spent), defaultdict(float)
        return spent


def profile_steps(
    mission: Mission, backend: str, on_progress: Callable[[float], None] = lambda _: None
) -> dict[str, tuple[float, float, float]]:
    """Fly a mission and return for each part of a step (median [ms], 99th percentile [ms], share of all time).

    "step" is the whole step, "the rest" is in no part; parts that the back-end lacks are left out. `on_progress`
    is called with the covered part, 0 to 1.

    Raises
    ------
    UserError
        For an unknown back-end.
    """
    law, watch = RecedingHorizon(mission, backend=backend), Stopwatch()
    with ExitStack() as stack:
        for name, places in PLACES.items():
            for place in places:
                owner, attribute = _owner(place)
                function = getattr(owner, attribute)
                stack.enter_context(patched(owner, attribute, watch.timed(name, function)))
        steps = _fly(mission, law, watch, on_progress)
    parts = {name: np.array([step.get(name, 0.0) for step in steps]) for name in [*PLACES, "the rest", "step"]}
    whole = max(float(parts["step"].sum()), 1e-12)
    return {
        name: (float(1e3 * np.median(each)), float(1e3 * np.percentile(each, 99)), float(each.sum()) / whole)
        for name, each in parts.items()
        if each.any()
    }


def _fly(
    mission: Mission, law: RecedingHorizon, watch: Stopwatch, on_progress: Callable[[float], None]
) -> list[dict[str, float]]:
    """Fly the plans exactly, until everything is covered; return the times by name of each step [s]."""
    period, state_period = mission.spec.control.period_s, mission.spec.control.state_period_s
    control, coverage = mission.spec.control, make_map(mission)
    still = np.zeros_like(mission.fleet.start)
    coverage.observe(0.0, mission.fleet.start)
    state = FleetState.nominal(mission.fleet.start, still, 0.0, settled=True)
    plan = law.step(state, coverage, Budget.counted(control.planning_time_s)).trajectory
    steps: list[dict[str, float]] = []
    for k in range(_LONGEST):
        now, then = k * period, (k + 1) * period
        for instant in np.append(np.arange(now + state_period, then - 1e-9, state_period), then):
            coverage.observe(float(instant), plan.at(float(instant))[0])
        on_progress(coverage.fraction)
        if coverage.complete and steps:
            break
        law.published(plan)
        held = {index: [plan.agent(index)] for index in range(plan.position.shape[1])}
        state = replace(FleetState.nominal(*plan.at(then), then), held=held)
        budget = Budget.counted(control.deadline_fraction * period)
        watch.reset()
        begun = time.perf_counter()
        plan = law.step(state, coverage, budget).trajectory
        whole = time.perf_counter() - begun
        spent = watch.reset()
        steps.append({**spent, "the rest": whole - sum(spent.values()), "step": whole})
    return steps


def _owner(place: str) -> tuple[Any, str]:
    """Return the module or class that holds "module:attribute" or "module:Class.attribute", and the attribute."""
    module, _, path = place.partition(":")
    owner: Any = import_module(module if module.startswith("solvers.") else f"mpc_cover.{module}")
    *classes, attribute = path.split(".")
    for name in classes:
        owner = getattr(owner, name)
    return owner, attribute
