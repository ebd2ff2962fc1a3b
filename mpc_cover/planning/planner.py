"""The planner as the controller sees it: a back-end is chosen here, and nowhere above."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.passive_safety import braking_violation
from mpc_cover.errors import UserError
from mpc_cover.planning.budget import Effort, Meter, late, part_of
from mpc_cover.planning.initial_guess.timed_sweeps import repaired, timed_sweeps
from mpc_cover.planning.metered_backend import metered
from mpc_cover.planning.min_time import plan_free_horizon, plan_min_time
from mpc_cover.planning.multistart import Search, multistart
from mpc_cover.planning.scp import evaluate, optimise
from mpc_cover.planning.task import gentle, needs_laps
from solvers.backends.registry import UnknownBackendError, make_backend

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from mpc_cover.arrays import FloatArray
    from mpc_cover.planning.ocp import OCP
    from mpc_cover.planning.scp import SCPResult
    from mpc_cover.planning.task import Candidate, Task

_FLIGHT_SHARPNESS = 40.0
"""In flight the minimum is as good as hard: what is planned is nearly what is flown."""
_ROOMY, _CROWDED = 0.8, 0.5
"""Parts of the time for plans with room to stop; the rest is for those without: more where that was needed before."""
_WORTH = 0.3
"""Plans with room to stop may leave this part of what is owed over for the next."""
_QUICK_PERIODS = 4.0
"""A plan in flight without a deadline may take so many periods' effort: more would be no picture of a real flight."""

_SWEEPS, _FEW_SWEEPS = 18, 3
"""Guesses that slow plans are made from at rest, and within a step."""
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
        self._meter = Meter()
        self._crowded = False
        try:
            self._backend = metered(make_backend(backend), self._meter)
        except UnknownBackendError as error:
            raise UserError(str(error)) from None

    def whole(self, task: Task, deadline: float | None, effort_s: float | None = None) -> Candidate:
        """Plan everything that is owed, thoroughly; without a deadline with so much effort [s] at the most."""
        if effort_s is not None:
            deadline = self._bounded(deadline, effort_s)
        return self._with_room(partial(plan_free_horizon, backend=self._backend), task, deadline)

    def quick(self, task: Task, deadline: float | None) -> Candidate:
        """Plan everything that is owed from a few starts, refined once if there is time; work is bounded, too."""
        deadline = self._bounded(deadline, _QUICK_PERIODS * task.period)
        few = partial(plan_free_horizon, backend=self._backend, attempts=1, search=Search(starts=3, finalists=1))
        return self._with_room(few, task, deadline)

    def timed_sweeps(self, task: Task, deadline: float | None, effort_s: float, *, thorough: bool) -> list[Candidate]:
        """Return plans that bring all looks in one go, as slow as that takes: from all sweeps, or from a few.

        Without a deadline repairs take so much effort [s] at the most.
        """
        deadline = self._bounded(deadline, effort_s)
        flown = timed_sweeps(task, _SWEEPS if thorough else _FEW_SWEEPS, part_of(deadline, _FLOWN))
        if any(candidate.complete for candidate in flown):
            return flown
        return [*flown, *repaired(task, flown, self._backend, _MENDED if thorough else 1, deadline)]

    def fixed(
        self,
        task: Task,
        steps: int,
        search: Search,
        deadline: float | None,
        told: Callable[[int, Candidate], None] | None = None,
        given: Mapping[str, FloatArray] | None = None,
    ) -> Candidate:
        """Plan exactly `steps` samples; see `multistart`."""
        return multistart(task, self._backend, steps, search, deadline, told, given)[0]

    def shortest(
        self, task: Task, search: Search, deadline: float | None, told: Callable[[int, Candidate], None] | None = None
    ) -> Candidate:
        """Plan everything that is owed in as few samples as the search finds."""
        return plan_min_time(task, self._backend, search=search, deadline=deadline, told=told)

    def polish(self, ocp: OCP, x: FloatArray, iterations: int, deadline: float | None) -> SCPResult:
        """Improve a motion that is already good by a few QPs: of many looks, by one around fewer samples."""
        return optimise(
            ocp,
            x,
            self._backend,
            sharpness=(_FLIGHT_SHARPNESS,),
            iterations=1 if needs_laps(ocp.looks) else iterations,
            deadline=deadline,
            **gentle(ocp.looks),
        )

    def evaluate(self, ocp: OCP, x: FloatArray) -> SCPResult:
        """Return what a motion is worth as it stands."""
        return evaluate(ocp, x)

    def _bounded(self, deadline: float | None, effort_s: float) -> float:
        """Return the deadline, or without one, that of so much effort [s]."""
        return Effort(self._meter, self._meter.spent_s + effort_s) if deadline is None else deadline

    def _with_room(self, plan: Callable[..., Candidate], task: Task, deadline: float | None) -> Candidate:
        """Plan with room to stop; where that leaves too much over, without, too: a crowd would hardly move."""
        if task.fleet.reaction == 0.0:
            return plan(task, deadline=deadline)
        roomy = plan(task, deadline=part_of(deadline, _CROWDED if self._crowded else _ROOMY))
        left, owed = np.count_nonzero(task.owed_after(roomy.plan)), np.count_nonzero(task.weight)
        self._crowded = not roomy.feasible or bool(left > _WORTH * owed)
        if not self._crowded or late(deadline):
            return roomy
        dense = plan(replace(task, fleet=replace(task.fleet, reaction=0.0)), deadline=deadline)
        flown = dense.plan
        exposed = braking_violation(flown.position, flown.velocity, flown.period, task.fleet)
        return min(roomy, replace(dense, braking_violation=exposed), key=lambda candidate: candidate.rank)
