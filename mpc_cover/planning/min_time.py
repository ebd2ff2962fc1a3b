"""Minimum-time planning: the shortest plan that covers the whole demand which a search finds."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from mpc_cover.planning.free_horizon import Watcher, plan_free_horizon
from mpc_cover.planning.from_rest import MANY
from mpc_cover.planning.initial_guess.guess import GuessKind, rest_guess
from mpc_cover.planning.multistart import Search, multistart, systematic_guesses
from mpc_cover.planning.segment_refinement import flown_in_steps

if TYPE_CHECKING:
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.candidate import Candidate
    from mpc_cover.planning.task import Task
    from solvers.backends.base import Backend

FAILURES = 3
"""Failed lengths in a row after which the minimum-time search ends; a plain choice."""
_MORE_STARTS, _FINALISTS, _MORE_FINALISTS = 8, 6, 4
"""Random starts added after each failed length, finalists, and finalists added, of that search; plain choices."""


def plan_min_time(
    task: Task,
    backend: Backend,
    *,
    search: Search,
    budget: Budget,
    watcher: Watcher | None = None,
    failures: int | None = FAILURES,
) -> Candidate:
    """Return the shortest plan that covers the whole demand which the search finds.

    Starts from a short plan and removes one sample at a time, with more starts and hops after each length that fails.
    The search ends after `failures` failed lengths in a row (None: when the budget is exhausted). `watcher` is told of
    each length tried and its best candidate.
    """
    watcher = watcher or Watcher()
    best = plan_free_horizon(task, backend, search=replace(search, rounds=0), budget=budget, watcher=watcher)
    watcher.found(best.plan.steps, best)
    return shortened(task, best, backend, search=search, budget=budget, watcher=watcher, failures=failures)


def shortened(
    task: Task,
    best: Candidate,
    backend: Backend,
    *,
    search: Search,
    budget: Budget,
    watcher: Watcher | None = None,
    failures: int | None = FAILURES,
) -> Candidate:
    """Return a complete plan, made shorter a sample at a time; arguments as in `plan_min_time`.

    Each length starts from the shortest plan so far, flown faster, before it tries other guesses.
    """
    watcher = watcher or Watcher()
    if not best.complete or best.kind is GuessKind.PARTS:  # which blocks have made as short as they can
        return best
    failed, systematic = 0, 0 if task.fleet.size >= MANY else len(systematic_guesses(task))
    while (failures is None or failed < failures) and best.plan.steps > task.least_steps and not budget.exhausted:
        more = replace(
            search,
            starts=systematic + _MORE_STARTS * failed,
            finalists=_FINALISTS + _MORE_FINALISTS * failed,
            seed=search.seed + failed,
            rounds=(search.rounds or 0) * 2**failed,
        )
        steps = best.plan.steps - 1
        watcher.tries(steps)
        ocp = task.ocp(steps)
        starts = {"shortened": flown_in_steps(ocp, best.plan.position, best.plan.velocity)}
        if task.fleet.size >= MANY:
            rest = ocp.decision_of(task.flown(rest_guess(task.position), steps))
            candidate = multistart(task, backend, steps, more, budget, given={**starts, "from rest": rest})[0]
        else:
            candidate = multistart(task, backend, steps, more, budget, known=starts)[0]
        watcher.found(steps, candidate)
        if candidate.complete:
            best, failed = candidate, 0
        else:
            failed += 1
    return best
