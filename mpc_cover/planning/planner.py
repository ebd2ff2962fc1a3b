"""The planner: the interface of trajectory optimisation to the control law, with one QP back-end."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, cast

import numpy as np

from mpc_cover.constraints.passive_safety import braking_violation
from mpc_cover.errors import UserError
from mpc_cover.planning.candidate import evaluate_motion
from mpc_cover.planning.extension import extended
from mpc_cover.planning.free_horizon import plan_free_horizon
from mpc_cover.planning.initial_guess.formation_sweeps import link_lanes
from mpc_cover.planning.initial_guess.guess import GuessKind, Origin
from mpc_cover.planning.initial_guess.timed_sweeps import repair_sweeps, timed_sweeps
from mpc_cover.planning.min_time import FAILURES, plan_min_time, shortened
from mpc_cover.planning.multistart import Search, multistart
from mpc_cover.planning.scp import descends_natively, evaluate, optimise
from mpc_cover.planning.shortening import Shortening
from mpc_cover.planning.task import multi_look_options, needs_laps
from solvers.backends.fallback import with_fallbacks
from solvers.backends.registry import UnknownBackendError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from mpc_cover.arrays import FloatArray
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.candidate import Candidate
    from mpc_cover.planning.free_horizon import Watcher
    from mpc_cover.planning.ocp import OCP
    from mpc_cover.planning.scp import SCPResult
    from mpc_cover.planning.task import Task
    from solvers.backends.base import Backend

_POLISH_SHARPNESS = 40.0
"""Sharpness of the soft minimum for plans that are good already; a plain choice close to the hard minimum."""
_SAFE_SHARE, _SAFE_SHARE_CROWDED = 0.8, 0.5
"""Parts of the budget for passively safe plans, the second where the last search found none that was sufficient; the
rest is for plans without passive safety. Plain choices."""
_SAFE_SHARE_TIGHT = 0.2
"""The same part for fleets whose links are shorter than a lane, which rarely have such plans; a plain choice."""
_SUFFICIENT_REST = 0.3
"""Part of the demand that a passively safe plan may leave to the next one; a plain choice."""
_QUICK_SEARCH = Search(starts=3, finalists=1)
"""The search for one length within a control step; a plain choice of what fits into it."""
_SHORTENING, _LENGTHS = Search(rounds=3), 1
"""The search for shorter plans while at rest, and the lengths in a row at which it may fail; plain choices."""
_FEW_SWEEPS = 3
"""Timed sweeps that are tried within a step; at rest all of them are. Plain choice."""
_SWEEPS_SHARE = 0.8
"""Part of the budget for generating timed sweeps; their repair has the rest. Plain choice."""
_REPAIRED = 3
"""Timed sweeps that are repaired at rest where none is complete; a plain choice, as repair takes longest."""


class Planner:
    """Searches for plans with one QP back-end, and with the others where that one fails.

    Raises
    ------
    UserError
        For an unknown back-end; the message lists the known ones.

    Attributes
    ----------
    qps_answered : number of QPs until now, by the name of the back-end that answered.
    """

    def __init__(self, backend: str) -> None:
        self._crowded = False
        try:
            solver = with_fallbacks(backend)
        except UnknownBackendError as error:
            raise UserError(str(error)) from None
        self.qps_answered: Mapping[str, int] = solver.answered
        self._chosen, self._backend = backend, cast("Backend", solver)

    def qps_of_others(self) -> dict[str, int]:
        """Return the number of QPs until now that the chosen back-end did not answer, by who did instead."""
        return {name: count for name, count in self.qps_answered.items() if name != self._chosen}

    def thorough(self, task: Task, budget: Budget) -> Candidate:
        """Plan for the whole demand from many starts, as well as the budget allows."""
        return self._passively_safe(self._thorough, task, budget)

    def _thorough(self, task: Task, *, budget: Budget) -> Candidate:
        best = plan_free_horizon(task, self._backend, budget=budget)
        if not descends_natively(task.ocp(best.plan.steps), self._backend):
            return best
        return shortened(task, best, self._backend, search=_SHORTENING, budget=budget, failures=_LENGTHS)

    def quick(self, task: Task, budget: Budget) -> Candidate:
        """Plan for the whole demand from a few starts at one length, as well as the budget allows."""
        few = partial(plan_free_horizon, backend=self._backend, attempts=1, search=_QUICK_SEARCH)
        return self._passively_safe(few, task, budget)

    def timed_sweeps(self, task: Task, budget: Budget, *, thorough: bool) -> list[Candidate]:
        """Return plans that take all looks in a single slow pass, from all sweeps if `thorough`, else from a few."""
        sweeps = timed_sweeps(task, None if thorough else _FEW_SWEEPS, budget.part(_SWEEPS_SHARE))
        if any(candidate.complete for candidate in sweeps):
            return sweeps
        return [*sweeps, *repair_sweeps(task, sweeps, self._backend, _REPAIRED if thorough else 1, budget)]

    def extended(self, task: Task, plan: Trajectory, budget: Budget) -> Candidate:
        """Return the evaluation of a plan, extended from its end at rest to the demand that it leaves."""
        origin = Origin(GuessKind.REPAIR, "as before")
        known = evaluate_motion(task, plan.position[0], plan.velocity, origin)
        return extended(task, known, self._backend, budget)

    def fixed(
        self,
        task: Task,
        steps: int,
        search: Search,
        budget: Budget,
        on_progress: Callable[[int, Candidate], None] | None = None,
        given: Mapping[str, FloatArray] | None = None,
    ) -> Candidate:
        """Plan over exactly `steps` steps; see `multistart.multistart`."""
        return multistart(task, self._backend, steps, search, budget, on_progress, given)[0]

    def shortest(
        self,
        task: Task,
        search: Search,
        budget: Budget,
        watcher: Watcher | None = None,
        *,
        failures: int | None = FAILURES,
    ) -> Candidate:
        """Plan for the whole demand in as few steps as the search finds; see `min_time.plan_min_time`."""
        return plan_min_time(task, self._backend, search=search, budget=budget, watcher=watcher, failures=failures)

    def polish(self, ocp: OCP, x: FloatArray, iterations: int, budget: Budget) -> SCPResult:
        """Improve a motion that is already good by a few QPs; for many looks, by one with fewer samples per term."""
        return optimise(
            ocp,
            x,
            self._backend,
            sharpness=(_POLISH_SHARPNESS,),
            iterations=1 if needs_laps(ocp.looks) else iterations,
            budget=budget,
            **multi_look_options(ocp.looks),
        )

    def descends_natively(self, ocp: OCP) -> bool:
        """Return whether descents on this OCP take so little time that there are many in an idle period."""
        return descends_natively(ocp, self._backend)

    def shortening(self, ocp: OCP, x: FloatArray) -> Shortening:
        """Return an anytime search for a complete motion of the OCP's length, from a guess."""
        return Shortening(ocp, x, self._backend)

    def evaluate(self, ocp: OCP, x: FloatArray) -> SCPResult:
        """Return the evaluation of a motion without any refinement."""
        return evaluate(ocp, x)

    def _passively_safe(self, plan: Callable[..., Candidate], task: Task, budget: Budget) -> Candidate:
        """Plan with passive safety; without it as well if that leaves too much, or is not attained by a tight fleet."""
        if task.fleet.reaction_periods == 0.0:
            return plan(task, budget=budget)
        tight = link_lanes(task) < 1.0
        usual = _SAFE_SHARE_CROWDED if self._crowded else _SAFE_SHARE
        safe = plan(task, budget=budget.part(_SAFE_SHARE_TIGHT if tight else usual))
        left, demanded = np.count_nonzero(task.remaining_after(safe.plan)), np.count_nonzero(task.weight)
        self._crowded = not safe.feasible or bool(left > _SUFFICIENT_REST * demanded)
        without = self._crowded or (tight and safe.violates_passive_safety)
        if not without or budget.exhausted:
            return safe
        unsafe = plan(replace(task, fleet=replace(task.fleet, reaction_periods=0.0)), budget=budget)
        motion = unsafe.plan
        violation = braking_violation(motion.position, motion.velocity, motion.period, task.fleet)
        return min(safe, replace(unsafe, braking_violation=violation), key=lambda candidate: candidate.rank)
