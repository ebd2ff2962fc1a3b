"""Free-horizon planning: a short plan that covers the whole demand, and the shortest (minimum-time) one found."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.coverage.nearest import remaining_weight
from mpc_cover.planning.basin_hopping import Pool, hop
from mpc_cover.planning.block_refinement import plan_by_blocks
from mpc_cover.planning.budget import GUESS_SAMPLE_S
from mpc_cover.planning.candidate import Candidate, candidate_of, evaluate_guess, evaluate_motion, guess_priority
from mpc_cover.planning.extension import completions
from mpc_cover.planning.initial_guess.formation_sweeps import link_lanes
from mpc_cover.planning.initial_guess.guess import GuessKind, Origin, rest_guess
from mpc_cover.planning.length_bracket import LengthBracket
from mpc_cover.planning.multistart import Search, multistart, systematic_guesses
from mpc_cover.planning.scp import SOFT_SHARPNESS, descends_natively, optimise
from mpc_cover.planning.segment_refinement import SEGMENT_STEPS, refine_segments, resampled

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.ocp import OCP
    from mpc_cover.planning.scp import SCPResult
    from mpc_cover.planning.task import Task
    from solvers.backends.base import Backend

_REST_STEPS, _REST_SHARE = 16, 0.3
"""First length tried from rest, and the part of the budget for plans from rest; plain choices."""
_REST_HOPS, _REST_LEFT, _REST_GAP = 4, 0.03, 0.06
"""Hops for each length; the part of the demand up to which the best motion may leave some for them; and the relative
gap between the shortest sufficient length and the longest insufficient one that is not bisected. Plain choices."""
_MANY = 16
"""Agents from which on plans from rest are made shorter instead of comparing them with guesses, which take long to make
and are worse; a plain choice: guesses for twenty agents take seconds."""
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
FAILURES = 3
"""Failed lengths in a row after which the minimum-time search ends; a plain choice."""
_MORE_STARTS, _FINALISTS, _MORE_FINALISTS = 8, 6, 4
"""Random starts added after each failed length, finalists, and finalists added, of that search; plain choices."""
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
    if spread is None or task.fleet.size < _MANY:
        guessed = _plan_from_guesses(task, backend, attempts, search, budget, watcher)
        return guessed if spread is None else min(spread, guessed, key=lambda candidate: candidate.rank)
    return spread


def plan_from_rest(task: Task, backend: Backend, budget: Budget) -> Candidate | None:
    """Return a short complete plan that spreads the fleet from where it stands, or None.

    Only where the library descends: softly enough, a descent from rest shares the cells out among the agents by itself.
    The lengths are bisected; each begins from rest, and then from the shortest plan so far, flown faster.
    """
    steps, too_short, best = max(_REST_STEPS, task.least_steps), task.least_steps - 1, None
    resting = rest_guess(task.position)
    origin = Origin(GuessKind.GIVEN, "spread from rest")
    while not budget.exhausted:
        ocp = task.ocp(steps)
        if not descends_natively(ocp, backend):
            break
        starts = [ocp.decision_of(task.flown(resting, steps))]
        if best is not None:
            velocity = resampled(best.plan.velocity, steps)
            starts.append(ocp.exact_ends(ocp.decision(best.plan.position[0], velocity)))
        if (found := _covered(ocp, starts, backend, budget)) is not None:
            best = candidate_of(task, steps, found, origin)
        if best is None or best.plan.steps != steps:
            too_short = steps
        steps = 2 * steps if best is None else (too_short + best.plan.steps) // 2
        if best is not None and best.plan.steps - too_short <= max(1.0, _REST_GAP * best.plan.steps):
            break
    return best


def _covered(ocp: OCP, starts: list[FloatArray], backend: Backend, budget: Budget) -> SCPResult | None:
    """Return the first complete motion that descents from some starts, and a few hops from there, find; or None."""
    pool, rng = Pool(ocp), np.random.default_rng(0)
    for x in starts:
        found = optimise(ocp, x, backend, sharpness=SOFT_SHARPNESS, budget=budget)
        if found.complete:
            return found
        pool.add(found)
    position, velocity = ocp.motion(pool.best.x)
    left = remaining_weight(position, ocp.cell, ocp.fleet.radius, ocp.weight, ocp.between(velocity)) > 0.0
    for _ in range(_REST_HOPS if np.count_nonzero(left) <= _REST_LEFT * np.count_nonzero(ocp.weight) else 0):
        if budget.exhausted:
            break
        found = hop(ocp, pool.drawn(rng), backend, rng, budget=budget)
        if found.complete:
            return found
        pool.add(found)
    return None


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
    failed, systematic = 0, 0 if task.fleet.size >= _MANY else len(systematic_guesses(task))
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
        faster = ocp.exact_ends(ocp.decision(best.plan.position[0], resampled(best.plan.velocity, steps)))
        starts = {"shortened": faster}
        if task.fleet.size >= _MANY:
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


def _evaluated_guesses(task: Task, search: Search, budget: Budget) -> list[Candidate]:
    """Return candidates of the systematic guesses, whose lengths estimate the work.

    All of them in a large search, else in proportion to its starts; as the budget allows, but at least one.
    """
    evaluated: list[Candidate] = []
    most, part = (
        (None if search.starts > _SCREENED else _GUESSES_PER_START * search.starts),
        budget.part(_GUESSES_SHARE),
    )
    for guess in systematic_guesses(task)[:most]:
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
