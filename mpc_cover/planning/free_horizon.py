"""Free-horizon planning: a short plan that covers the whole demand."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from mpc_cover.planning.block_refinement import plan_by_blocks
from mpc_cover.planning.budget import GUESS_SAMPLE_S
from mpc_cover.planning.candidate import Candidate, evaluate_guess, evaluate_motion, guess_priority
from mpc_cover.planning.extension import completions
from mpc_cover.planning.from_rest import MANY, plan_from_rest
from mpc_cover.planning.initial_guess.formation_sweeps import link_lanes
from mpc_cover.planning.initial_guess.guess import GuessKind, rest_guess
from mpc_cover.planning.length_bracket import LengthBracket
from mpc_cover.planning.multistart import Search, multistart, systematic_guesses
from mpc_cover.planning.scp import descends_natively
from mpc_cover.planning.segment_refinement import SEGMENT_STEPS, refine_segments

if TYPE_CHECKING:
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.task import Task
    from solvers.backends.base import Backend

_REST_SHARE = 0.3
"""Part of the budget for plans from rest; a plain choice."""
_UPPER_SHARE, _LOWER_SHARE = 0.92, 0.76
"""Parts of the length of initial guesses: refined plans nearly always exist at the first and never at the second, as
observed. The bisection over lengths starts from them."""
_SCREENED = 6
"""Initial guesses that must have been compared before the search is restricted to the best kinds; a plain choice."""
_GUESSES_PER_START = 2
"""Initial guesses that a small search evaluates for each of its starts; a plain choice."""
_GUESSES_SHARE = 0.3
"""Part of the budget for evaluating initial guesses; a plain choice."""
_APART_SHARE = 0.3
"""Part of the budget for guesses that are out of range; a plain choice."""
_SUFFICIENT_REST = 0.1
"""Part of the cells that a guess may leave for its length to count as an estimate of the work; nearly all guesses in
the plane leave less. Plain choice."""
_KEPT_NAMES = 3
"""Initial guesses that are kept for other lengths; a plain choice."""
_ATTEMPTS = 10
"""Lengths that a free-horizon search tries; a plain choice."""
_EXTENDED = 3
"""Plans that are extended to cells that they leave; a plain choice."""
_TOGETHER_SHARE = 0.4
"""Part of the budget for flights in formation where agents could go their own ways as well; a plain choice."""
_LARGE = 500
"""Samples times agents above which one QP for the whole plan takes too long, and plans are refined by segments; a plain
choice."""
_VIOLATION_COST = 2.0
"""Relative increase of a guess's length per metre of violation [1/m] where large guesses are ordered; plain choice."""
_LARGE_PASSES, _LARGE_TRIED, _LARGE_SHARE = 3, 3, 0.8
"""Passes over a large plan, guesses that are tried, and the part of the budget that they share; plain choices."""


class Watcher:
    """Is told what a search tries and finds; this one does nothing about it."""

    def tries(self, steps: int) -> None:
        """Hear that plans of so many steps are looked for."""

    def found(self, steps: int, candidate: Candidate) -> None:
        """Hear of the best plan found of so many steps, or of a better one."""


def plan_free_horizon(
    task: Task,
    backend: Backend,
    *,
    attempts: int = _ATTEMPTS,
    search: Search | None = None,
    budget: Budget,
    watcher: Watcher | None = None,
) -> Candidate:
    """Return a short plan that covers the whole demand, or the best one found; anytime.

    Starts from a length that is mostly sufficient and bisects between sufficient and insufficient lengths. Plans that
    leave cells are extended to them at the end. `attempts` bounds the lengths tried; `watcher` is told of each.

    Large fleets sweep parts, refined block by block, wherever that gives a complete plan.
    A fleet whose links are shorter than a lane flies in formation; one whose links are hardly longer may.
    """
    search, watcher = search or Search(), watcher or Watcher()
    spread = plan_from_rest(task, backend, budget.part(_REST_SHARE))
    if (by_blocks := plan_by_blocks(task, backend, budget)) is not None:
        return by_blocks if spread is None else min(spread, by_blocks, key=lambda candidate: candidate.rank)
    if spread is None or task.fleet.size < MANY:
        guessed = _plan_from_guesses(task, backend, attempts, search, budget, watcher)
        return guessed if spread is None else min(spread, guessed, key=lambda candidate: candidate.rank)
    return spread


def _plan_from_guesses(
    task: Task, backend: Backend, attempts: int, search: Search, budget: Budget, watcher: Watcher
) -> Candidate:
    """Plan from initial guesses; see `plan_free_horizon`."""
    evaluated = _evaluated_guesses(task, search, budget)
    rest = evaluate_guess(task, rest_guess(task.position), task.least_steps)
    together = [candidate for candidate in evaluated if candidate.kind is GuessKind.FORMATION]
    if not together:
        return _plan_apart(task, backend, [*evaluated, rest], attempts, search, budget, watcher)
    tight = link_lanes(task) < 1.0
    best = _plan_large(task, backend, [*together, rest], budget if tight else budget.part(_TOGETHER_SHARE), watcher)
    apart = [candidate for candidate in evaluated if candidate.kind is not GuessKind.FORMATION]
    if tight or not apart or budget.exhausted:
        return best
    search = replace(search, names=tuple(candidate.origin.name for candidate in apart))
    separate = _plan_apart(task, backend, [*apart, rest], attempts, search, budget, watcher)
    return min(best, separate, key=lambda one: one.rank)


def _plan_apart(
    task: Task,
    backend: Backend,
    evaluated: list[Candidate],
    attempts: int,
    search: Search,
    budget: Budget,
    watcher: Watcher,
) -> Candidate:
    """Plan from guesses in which agents go their own ways, of which rest is the last; see `plan_free_horizon`."""
    apart = [candidate for candidate in evaluated if candidate.kind is GuessKind.SHAPE_APART]
    found = [candidate for candidate in evaluated if candidate not in apart]
    moving = found[:-1] or apart
    work, least = _work(task, moving), min(candidate.plan.steps for candidate in moving)
    if work * task.fleet.size > _LARGE and not descends_natively(task.ocp(work), backend):
        in_order = sorted(found, key=partial(guess_priority, violation_cost=_VIOLATION_COST))
        return _plan_large(task, backend, in_order, budget, watcher)
    bracket = LengthBracket(round(_LOWER_SHARE * least), task.least_steps)
    steps = max(task.least_steps, round(_UPPER_SHARE * work))
    if apart and (together := _brought_together(task, backend, apart, search, budget)).complete:
        found.append(together)
        search = replace(search, names=_names([together]))
        bracket = LengthBracket(round(_LOWER_SHARE * together.plan.steps), task.least_steps, together.plan.steps)
        steps = bracket.assumed
    for _ in range(attempts):
        if budget.exhausted:
            break
        watcher.tries(steps)
        candidates = multistart(task, backend, steps, search, budget)
        best = candidates[0]
        watcher.found(steps, best)
        found.append(best)
        if len(candidates) > _SCREENED:
            search = replace(search, names=_names(candidates))
        left = float(task.remaining_after(best.plan).astype(bool).mean())
        bracket = bracket.after(steps, complete=best.complete)
        following = bracket.following(steps, left)
        if following is None:
            break
        steps = following
    return _finished(task, found, backend, budget)


def _finished(task: Task, found: list[Candidate], backend: Backend, budget: Budget) -> Candidate:
    """Return the best of the candidates found, the most promising extended to what they leave; at least one is."""
    finished: list[Candidate] = []
    for candidate in sorted((one for one in found if one.feasible), key=_extension_order)[:_EXTENDED]:
        if finished and budget.exhausted:
            break
        finished += completions(task, candidate, backend, budget)
    return min([*finished, *found], key=lambda candidate: candidate.rank)


def _brought_together(
    task: Task, backend: Backend, apart: list[Candidate], search: Search, budget: Budget
) -> Candidate:
    """Return the best plan found from guesses that are out of range, in as many steps as these take."""
    steps = max(task.least_steps, min(candidate.plan.steps for candidate in apart))
    alone = replace(search, names=_names(apart))
    return multistart(task, backend, steps, alone, budget.part(_APART_SHARE))[0]


def _extension_order(candidate: Candidate) -> tuple[bool, bool, float]:
    """Sort key of plans that may leave something: those that move, are passively safe, are short and leave little."""
    idle = candidate.kind is GuessKind.REST and not candidate.covers
    return idle, candidate.violates_passive_safety, guess_priority(candidate, _VIOLATION_COST)


def _plan_large(
    task: Task, backend: Backend, evaluated: list[Candidate], budget: Budget, watcher: Watcher
) -> Candidate:
    """Refine the best guesses segment by segment, then extend them to the cells that they leave."""
    resting = next(candidate for candidate in evaluated if candidate.kind is GuessKind.REST)
    found = [resting]
    guesses = [candidate for candidate in evaluated if candidate is not resting]
    for number, guess in enumerate(guesses[:_LARGE_TRIED]):
        if budget.exhausted:
            break
        part = budget.part(_LARGE_SHARE / (_LARGE_TRIED - number))
        watcher.tries(guess.plan.steps)
        motion = (guess.plan.position, guess.plan.velocity)
        position, velocity = refine_segments(
            task, motion, backend, length=SEGMENT_STEPS, passes=_LARGE_PASSES, budget=part
        )
        found.append(evaluate_motion(task, position[0], velocity, guess.origin))
        watcher.found(found[-1].plan.steps, found[-1])
        safe = found[-1].feasible and not found[-1].violates_passive_safety
        if found[-1].complete if guess.kind is GuessKind.FORMATION else safe:
            break
    found += [guess for guess in guesses if guess.feasible]
    return _finished(task, found, backend, budget)


def _evaluated_guesses(task: Task, search: Search, budget: Budget) -> list[Candidate]:
    """Return candidates of the systematic guesses, whose lengths estimate the work.

    All of them in a large search, else in proportion to its starts; as the budget allows, but at least one.
    """
    evaluated: list[Candidate] = []
    most, part = (
        (None if search.starts > _SCREENED else _GUESSES_PER_START * search.starts),
        budget.part(_GUESSES_SHARE),
    )
    for guess in systematic_guesses(task, part)[:most]:
        if evaluated and part.exhausted:
            break
        evaluated.append(evaluate_guess(task, guess))
        budget.charge(GUESS_SAMPLE_S * evaluated[-1].plan.steps)
    return evaluated


def _work(task: Task, guesses: list[Candidate]) -> int:
    """Return the steps of the shortest guess that measures nearly all cells, or of the one that leaves fewest."""
    left = [float((task.remaining_after(guess.plan) > 0.0).mean()) for guess in guesses]
    sufficient = max(_SUFFICIENT_REST, min(left))
    return min(guess.plan.steps for guess, rest in zip(guesses, left, strict=True) if rest <= sufficient)


def _names(candidates: list[Candidate]) -> tuple[str, ...]:
    """Return the names of the best moving candidates, without repetition."""
    moving = (candidate.origin.name for candidate in candidates if candidate.kind is not GuessKind.REST)
    return tuple(dict.fromkeys(moving))[:_KEPT_NAMES]
