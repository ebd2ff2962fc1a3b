"""The planner as the controller sees it: a back-end is chosen here, and nowhere above."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.passive_safety import braking_violation
from mpc_cover.errors import UserError
from mpc_cover.planning.initial_guess.timed_sweeps import repair_sweeps, timed_sweeps
from mpc_cover.planning.min_time import FAILURES, plan_free_horizon, plan_min_time
from mpc_cover.planning.multistart import Search, multistart
from mpc_cover.planning.scp import evaluate, optimise
from mpc_cover.planning.task import multi_look_options, needs_laps
from solvers.backends.registry import UnknownBackendError, make_backend

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from mpc_cover.arrays import FloatArray
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.candidate import Candidate
    from mpc_cover.planning.ocp import OCP
    from mpc_cover.planning.scp import SCPResult
    from mpc_cover.planning.task import Task

_FLIGHT_SHARPNESS = 40.0
"""In flight the minimum is as good as hard: what is planned is nearly what is flown."""
_ROOMY, _CROWDED = 0.8, 0.5
"""Parts of the time for plans with room to stop; the rest is for those without: more where that was needed before."""
_WORTH = 0.3
"""Plans with room to stop may leave this part of what is owed over for the next."""
_FEW_SWEEPS = 3
"""Guesses that slow plans are made from within a step; at rest all of them."""
_FLOWN = 0.8
"""Part of the time for slow plans that flying them takes at the most; repairs have the rest."""
_MENDED = 3
"""If none is complete as it flies, so many are repaired at rest: that takes longer than all the others together."""


class Planner:
    """One back-end and the ways it is used.

    Raises
    ------
    UserError
        For an unknown back-end; the message lists those there are.
    """

    def __init__(self, backend: str) -> None:
        self._crowded = False
        try:
            self._backend = make_backend(backend)
        except UnknownBackendError as error:
            raise UserError(str(error)) from None

    def thorough(self, task: Task, budget: Budget) -> Candidate:
        """Plan everything that is owed from many starts, as well as the budget allows."""
        return self._with_room(partial(plan_free_horizon, backend=self._backend), task, budget)

    def quick(self, task: Task, budget: Budget) -> Candidate:
        """Plan everything that is owed from a few starts, refined once if the budget allows."""
        few = partial(plan_free_horizon, backend=self._backend, attempts=1, search=Search(starts=3, finalists=1))
        return self._with_room(few, task, budget)

    def timed_sweeps(self, task: Task, budget: Budget, *, thorough: bool) -> list[Candidate]:
        """Return plans that bring all looks in one go, as slow as that takes: from all sweeps, or from a few."""
        flown = timed_sweeps(task, None if thorough else _FEW_SWEEPS, budget.part(_FLOWN))
        if any(candidate.complete for candidate in flown):
            return flown
        return [*flown, *repair_sweeps(task, flown, self._backend, _MENDED if thorough else 1, budget)]

    def fixed(
        self,
        task: Task,
        steps: int,
        search: Search,
        budget: Budget,
        on_progress: Callable[[int, Candidate], None] | None = None,
        given: Mapping[str, FloatArray] | None = None,
    ) -> Candidate:
        """Plan exactly `steps` samples; see `multistart`."""
        return multistart(task, self._backend, steps, search, budget, on_progress, given)[0]

    def shortest(
        self,
        task: Task,
        search: Search,
        budget: Budget,
        on_progress: Callable[[int, Candidate], None] | None = None,
        *,
        failures: int | None = FAILURES,
    ) -> Candidate:
        """Plan everything that is owed in as few samples as the search finds; see `plan_min_time`."""
        return plan_min_time(
            task, self._backend, search=search, budget=budget, on_progress=on_progress, failures=failures
        )

    def polish(self, ocp: OCP, x: FloatArray, iterations: int, budget: Budget) -> SCPResult:
        """Improve a motion that is already good by a few QPs: of many looks, by one around fewer samples."""
        return optimise(
            ocp,
            x,
            self._backend,
            sharpness=(_FLIGHT_SHARPNESS,),
            iterations=1 if needs_laps(ocp.looks) else iterations,
            budget=budget,
            **multi_look_options(ocp.looks),
        )

    def evaluate(self, ocp: OCP, x: FloatArray) -> SCPResult:
        """Return what a motion is worth as it stands."""
        return evaluate(ocp, x)

    def _with_room(self, plan: Callable[..., Candidate], task: Task, budget: Budget) -> Candidate:
        """Plan with room to stop; where that leaves too much over, without, too: a crowd would hardly move."""
        if task.fleet.reaction_periods == 0.0:
            return plan(task, budget=budget)
        roomy = plan(task, budget=budget.part(_CROWDED if self._crowded else _ROOMY))
        left, owed = np.count_nonzero(task.remaining_after(roomy.plan)), np.count_nonzero(task.weight)
        self._crowded = not roomy.feasible or bool(left > _WORTH * owed)
        if not self._crowded or budget.exhausted:
            return roomy
        dense = plan(replace(task, fleet=replace(task.fleet, reaction_periods=0.0)), budget=budget)
        flown = dense.plan
        exposed = braking_violation(flown.position, flown.velocity, flown.period, task.fleet)
        return min(roomy, replace(dense, braking_violation=exposed), key=lambda candidate: candidate.rank)
