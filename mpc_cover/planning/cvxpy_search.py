"""The search of `plan --formulation cvxpy`: from several initial guesses, each refined by subproblems in CVXPY."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.errors import UserError
from mpc_cover.planning.candidate import candidate_of, evaluate_guess
from mpc_cover.planning.cvxpy_extra.statuses import INFEASIBLE, USABLE
from mpc_cover.planning.cvxpy_problem import StatusLog, UserProblem
from mpc_cover.planning.cvxpy_scp import optimise_with_cvxpy, restored
from mpc_cover.planning.initial_guess.guess import rest_guess
from mpc_cover.planning.multistart import Search, initial_guesses, systematic_guesses

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.local_frame import LocalFrame
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.candidate import Candidate
    from mpc_cover.planning.cvxpy_extra.extra import Extra
    from mpc_cover.planning.cvxpy_problem import Found
    from mpc_cover.planning.initial_guess.guess import Origin
    from mpc_cover.planning.task import Task

_PENALTY = 50.0
"""Cost of a unit of violation where guesses are put in order, as in `ocp.Settings`."""
_LENGTHS = (1.0, 1.15, 1.3)
"""Lengths of plans that take as long as it takes, in those of the best guess as it is flown; a plain choice."""
_LEAVES_LITTLE = 0.1
"""Part of the cells that a guess may leave for its length to count as an estimate, as in `min_time`."""


@dataclass(frozen=True, eq=False)
class CvxpySearch:
    """A search for plans by subproblems in CVXPY.

    Attributes
    ----------
    task : in the local `frame` of the `mission`.
    search : how many guesses are compared, and how many of them are refined.
    extra : the user's parts, or None.
    log : takes in the status of each subproblem.
    keep : is called with the length and each better plan that keeps all constraints.
    on_progress : likewise, with the best one from each guess.
    """

    task: Task
    mission: Mission
    frame: LocalFrame
    search: Search
    extra: Extra | None
    log: StatusLog
    budget: Budget
    keep: Callable[[int, Candidate], None]
    on_progress: Callable[[int, Candidate], None]

    def fixed(self, steps: int) -> Candidate:
        """Return the best plan found of so many steps; it may violate constraints.

        Raises
        ------
        UserError
            The user's constraints leave no motion, the terms have no lower bound, or something is wrong with them.
        """
        return self._over(steps)[0]

    def as_long_as_it_takes(self) -> Candidate:
        """Return the best plan found, as long as the best guess or somewhat longer; raises as `fixed`."""
        flown = [evaluate_guess(self.task, guess) for guess in systematic_guesses(self.task)]
        left = [float((self.task.remaining_after(one.plan) > 0.0).mean()) for one in flown]
        limit = max(_LEAVES_LITTLE, min(left))
        work = min(one.plan.steps for one, rest in zip(flown, left, strict=True) if rest <= limit)
        found: list[tuple[Candidate, Found]] = []
        for factor in _LENGTHS:
            if found and (self.budget.exhausted or (found[-1][1].holds and found[-1][0].cost == 0.0)):
                break
            found.append(self._over(max(self.task.least_steps, round(factor * work))))
        return min(found, key=lambda pair: pair[1].rank)[0]

    def _over(self, steps: int) -> tuple[Candidate, Found]:
        problem = self._problem(steps)
        starts = self._starts(problem, steps)
        found: list[tuple[Candidate, Found]] = []
        infeasible = 0
        for origin, x, _ in starts:
            if max(len(found), infeasible) >= self.search.finalists or any(one.complete for _, one in found):
                break
            if found and self.budget.exhausted:
                break
            start, status = restored(problem, x, self.budget)
            if status in INFEASIBLE:
                infeasible += 1
                continue
            best = optimise_with_cvxpy(problem, start, self.budget, partial(self._keep, steps, origin))
            candidate = candidate_of(self.task, steps, best.result, origin)
            found.append((candidate, best))
            if best.holds:
                self.on_progress(steps, candidate)
        if not found:
            raise UserError(_infeasible(problem, starts[0][1], infeasible))
        if not any(one.holds for _, one in found):
            found.append(self._at_rest(problem, steps))
        return min(found, key=lambda pair: pair[1].rank)

    def _at_rest(self, problem: UserProblem, steps: int) -> tuple[Candidate, Found]:
        """Return the plan to stay where the fleet is, as far as the user's constraints let it: there is always that."""
        guess = rest_guess(self.task.position)
        x, _ = restored(problem, problem.ocp.decision_of(self.task.flown(guess, steps)), self.budget)
        best = problem.found(x)
        return candidate_of(self.task, steps, best.result, guess.origin), best

    def _keep(self, steps: int, origin: Origin, best: Found) -> None:
        if best.holds:
            self.keep(steps, candidate_of(self.task, steps, best.result, origin))

    def _problem(self, steps: int) -> UserProblem:
        exact = self.search.exact_cones
        ocp = self.task.ocp(steps)
        return UserProblem(ocp, self.mission, self.frame, self.extra, self.log, exact_cones=exact)

    def _starts(self, problem: UserProblem, steps: int) -> list[tuple[Origin, FloatArray, Found]]:
        """Return decision vectors of guesses, the most promising first."""
        starts: list[tuple[Origin, FloatArray, Found]] = []
        for guess in islice(initial_guesses(self.task, self.search), self.search.starts):
            if starts and self.budget.exhausted:
                break
            x = problem.ocp.decision_of(self.task.flown(guess, steps))
            if any(np.array_equal(x, other) for _, other, _ in starts):
                continue  # a sweep that is its own mirror image, or never gets to where it differs
            starts.append((guess.origin, x, problem.found(x)))
        return sorted(starts, key=lambda start: _promise(start[2]))


def _promise(found: Found) -> float:
    """Return what a guess costs with the penalty of what it violates, in local units."""
    own = 0.0 if found.extra is None else found.extra.violation / found.length
    return found.merit + _PENALTY * (found.result.violation + own)


def _infeasible(problem: UserProblem, x: FloatArray, starts: int) -> str:
    """Return why there is no motion: whether without the user's constraints there is one, and which leave none."""
    extra = problem.extra
    assert extra is not None
    judged = problem.judged(x)
    without = problem.nearest(x, groups=set())[0]
    span = f"of {problem.ocp.steps * problem.ocp.period:g} s"
    if without not in USABLE:
        name = problem.mission.spec.name
        return f"mission {name}: no motion {span} keeps its limits and ends, extra {extra.name} or not"
    names = [group.name for group in judged.groups] if judged is not None else []
    alone = [name for name in names if problem.nearest(x, groups={name})[0] in INFEASIBLE]
    which = f"{', '.join(alone)} alone" if alone else "only all of them together"
    return (
        f"extra {extra.name}: its constraints leave no motion {span} within limits, box and ends: CVXPY's status is "
        f"infeasible with them ({problem.log.solver}, from {starts} guesses), {without} without; infeasible: {which}"
    )
