"""Plans of whatever length covers everything: short ones, and the shortest that is found."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.planning.budget import FLIGHT_S
from mpc_cover.planning.candidate import Candidate, evaluate_guess, evaluate_motion, guess_priority
from mpc_cover.planning.initial_guess.formation import FormationFlight
from mpc_cover.planning.initial_guess.guess import GuessKind, Origin, rest_guess
from mpc_cover.planning.initial_guess.tour import tour_guess
from mpc_cover.planning.multistart import Search, multistart, systematic_guesses
from mpc_cover.planning.segment_refinement import refine_segments

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.task import Task
    from solvers.backends.base import Backend

_EASY, _HARD = 0.92, 0.76
"""Refined plans nearly always exist in the first part of the time in which a guess flies, and never in the second."""
_SCREENED = 6
"""So many guesses must have been compared before only the best kinds go on."""
_FLYING = 0.3
"""Part of the time that flying guesses may take."""
_SUFFICES = 0.1
"""A guess is a measure of the work if it leaves no more than this part of the cells: in the plane nearly all do."""
_KEPT = 3
"""Kinds of guesses that are tried again at other lengths."""
FAILURES = 3
"""Lengths in a row that may fail before the search for a shorter plan ends."""
_FINALISTS = 3
"""Plans that are flown on to what they leave over, when none covers everything."""
_EXTENSIONS = 3
_LARGE = 500
"""Samples times agents beyond which one QP for the whole plan takes too long."""
_REPAIR = 2.0
"""What a metre of violation adds to the time that a guess promises, as a part of it."""
_STRETCH, _PASSES, _TRIED = 24, 3, 3
"""Samples of a stretch, passes over a plan, and guesses that are tried, of large plans."""


def plan_free_horizon(
    task: Task,
    backend: Backend,
    *,
    attempts: int = 5,
    search: Search | None = None,
    budget: Budget,
) -> Candidate:
    """Return a short plan that covers everything owed, or the best one found; anytime.

    Begins with a length at which the first guess mostly suffices, and bisects between what covers everything
    and what does not. What is still left over is flown to at the end. `attempts` bounds the lengths tried.
    """
    search = search or Search()
    found = _flights(task, search, budget)
    work, least = _work(task, found), min(candidate.plan.steps for candidate in found)
    found.append(evaluate_guess(task, rest_guess(task.position), task.least_steps))
    if work * task.fleet.size > _LARGE:
        return _plan_large(task, backend, sorted(found, key=partial(guess_priority, repair=_REPAIR)), budget)
    steps, too_short = max(task.least_steps, round(_EASY * work)), round(_HARD * least)
    shortest = 0
    for _ in range(attempts):
        if budget.exhausted:
            break
        candidates = multistart(task, backend, steps, search, budget)
        best = candidates[0]
        found.append(best)
        if best.complete:
            shortest = steps
        else:
            too_short = max(too_short, steps)
        if len(candidates) > _SCREENED:
            search = replace(search, names=_names(candidates))
        if shortest:
            steps = max(task.least_steps, (too_short + shortest) // 2)
        else:
            left = float(task.remaining_after(best.plan).astype(bool).mean())
            steps += max(2, round(min(max(left, 0.06), 0.3) * steps))
        if steps in {too_short, shortest}:
            break
    found.sort(key=lambda candidate: candidate.rank)
    finished = [_extended(task, candidate, backend, budget) for candidate in found[:_FINALISTS] if candidate.feasible]
    return min([*finished, *found], key=lambda candidate: candidate.rank)


def _plan_large(task: Task, backend: Backend, flown: list[Candidate], budget: Budget) -> Candidate:
    """Repair and improve the best guesses stretch by stretch, then fly on to what is left over."""
    resting = next(candidate for candidate in flown if candidate.kind is GuessKind.REST)
    found = [resting]
    guesses = [candidate for candidate in flown if candidate is not resting]
    for number, guess in enumerate(guesses[:_TRIED]):
        if budget.exhausted:
            break
        until = budget.part(0.8 / (_TRIED - number))
        motion = (guess.plan.position, guess.plan.velocity)
        position, velocity = refine_segments(task, motion, backend, length=_STRETCH, passes=_PASSES, budget=until)
        found.append(evaluate_motion(task, position[0], velocity, guess.origin))
        if found[-1].feasible:
            break
    found += [guess for guess in guesses if guess.feasible]
    finished = [_extended(task, candidate, backend, budget) for candidate in found if candidate.feasible]
    return min([*finished, *found], key=lambda candidate: candidate.rank)


def plan_min_time(
    task: Task,
    backend: Backend,
    *,
    search: Search,
    budget: Budget,
    on_progress: Callable[[int, Candidate], None] | None = None,
    failures: int | None = FAILURES,
) -> Candidate:
    """Return the shortest plan that covers everything which the search finds.

    Starts from a short plan and removes one sample at a time, with more starts and hops after each length that fails.
    The search ends after `failures` failed lengths in a row (None: when the budget is exhausted). `on_progress` is
    called with each length tried and its best candidate.
    """
    best = plan_free_horizon(task, backend, search=replace(search, rounds=0), budget=budget)
    if not best.complete:
        return best
    failed, systematic = 0, len(systematic_guesses(task))
    while (failures is None or failed < failures) and best.plan.steps > task.least_steps and not budget.exhausted:
        more = replace(
            search,
            starts=systematic + 8 * failed,
            finalists=6 + 4 * failed,
            seed=search.seed + failed,
            rounds=(search.rounds or 0) * 2**failed,
        )
        steps = best.plan.steps - 1
        candidate = multistart(task, backend, steps, more, budget)[0]
        if on_progress is not None:
            on_progress(steps, candidate)
        if candidate.complete:
            best, failed = candidate, 0
        else:
            failed += 1
    return best


def _flights(task: Task, search: Search, budget: Budget) -> list[Candidate]:
    """Fly systematic guesses to their ends: what they take is a measure of the work.

    All of them where there is time, else twice as many as are to be told apart; one at the least.
    """
    flights: list[Candidate] = []
    most, enough = (None if search.starts > _SCREENED else 2 * search.starts), budget.part(_FLYING)
    for guess in systematic_guesses(task)[:most]:
        if flights and enough.exhausted:
            break
        flights.append(evaluate_guess(task, guess))
        budget.charge(FLIGHT_S * flights[-1].plan.steps)
    return flights


def _work(task: Task, flights: list[Candidate]) -> int:
    """Return the samples of the shortest guess that measures nearly everything, or of the one that leaves least."""
    left = [float((task.remaining_after(flight.plan) > 0.0).mean()) for flight in flights]
    enough = max(_SUFFICES, min(left))
    return min(flight.plan.steps for flight, rest in zip(flights, left, strict=True) if rest <= enough)


def _names(candidates: list[Candidate]) -> tuple[str, ...]:
    """Return the names of the best candidates, each once."""
    moving = (candidate.origin.name for candidate in candidates if candidate.kind is not GuessKind.REST)
    return tuple(dict.fromkeys(moving))[:_KEPT]


def _extended(task: Task, candidate: Candidate, backend: Backend, budget: Budget) -> Candidate:
    """Fly on to what the candidate leaves over, from its end at rest."""
    for _ in range(_EXTENSIONS):
        weight = task.remaining_after(candidate.plan)
        if not (weight > 0.0).any():
            break
        end = candidate.plan
        rest = replace(
            task, weight=weight, position=end.position[-1], velocity=end.velocity[-1], start_time=end.end_time
        )
        more = _flown_on(rest, backend, budget)
        if more is None:
            break
        candidate = _joined(task, candidate, more)
    return candidate


def _flown_on(rest: Task, backend: Backend, budget: Budget) -> Candidate | None:
    """Return how to measure some more of what is left over, by a tour, or as one body; None if nothing does."""
    more = evaluate_guess(rest, tour_guess(rest.fleet, rest.cell, rest.weight, rest.position))
    if not more.feasible and not budget.exhausted:
        more = multistart(rest, backend, more.plan.steps, Search(starts=2, finalists=1), budget)[0]
    if _leads_on(rest, more):
        return more
    together = (evaluate_guess(rest, guess) for guess in FormationFlight(budget).guesses(rest))
    return next((one for one in together if _leads_on(rest, one)), None)


def _leads_on(rest: Task, more: Candidate) -> bool:
    """Return whether a plan is feasible and leaves less than there was."""
    left = np.count_nonzero(rest.remaining_after(more.plan))
    return more.feasible and bool(left < np.count_nonzero(rest.weight))


def _joined(task: Task, first: Candidate, second: Candidate) -> Candidate:
    velocity = np.concatenate([first.plan.velocity, second.plan.velocity[1:]])
    origin = Origin(first.kind, f"{first.origin.name}, then {second.origin.name}")
    return evaluate_motion(task, first.plan.position[0], velocity, origin)
