"""Extension of a plan to what it leaves, however far: transit and tour from its end at rest, as long as they take.

The QP of a whole plan neither reaches beyond its length nor repairs a long transit that violates a distance. The
motions here do not depend on it: agents tour what is left one by one, with departures that keep them apart, or, where
the communication range demands it, the fleet moves as one body.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.tolerances import AT_REST
from mpc_cover.planning.budget import GUESS_SAMPLE_S
from mpc_cover.planning.candidate import Candidate, evaluate_guess, evaluate_motion
from mpc_cover.planning.initial_guess.formation import FormationFlight
from mpc_cover.planning.initial_guess.formation_sweeps import link_lanes
from mpc_cover.planning.initial_guess.guess import Guess, GuessKind, Origin
from mpc_cover.planning.initial_guess.plan_repair import motion_with_detours, waypoints_of
from mpc_cover.planning.initial_guess.staggered_tour import StaggeredTour
from mpc_cover.planning.initial_guess.towing import Towing
from mpc_cover.planning.multistart import Search, multistart

if TYPE_CHECKING:
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.initial_guess.interface import InitialGuess
    from mpc_cover.planning.task import Task
    from solvers.backends.base import Backend

_EXTENSIONS = 6
"""Extensions of a plan, each to what the one before leaves; a plain choice."""
_SEARCH = Search(starts=2, finalists=1)
"""The search for an extension where no motion is feasible as it is; a plain choice of the least effort."""


def completions(task: Task, candidate: Candidate, backend: Backend, budget: Budget) -> list[Candidate]:
    """Return what a candidate becomes with a way back to the cells that it leaves, and with detours to them.

    None if it leaves none; at least one otherwise, which may be the candidate itself.
    """
    if candidate.covers:
        return []
    found = [extended(task, candidate, backend, budget)]
    if candidate.kind is GuessKind.REST:
        return found
    detours = motion_with_detours(task, candidate.plan, waypoints_of(candidate.plan))
    if detours is not None:
        origin = candidate.origin._replace(name=f"{candidate.origin.name}, with detours")
        budget.charge(GUESS_SAMPLE_S * detours.steps)
        passing = evaluate_guess(task, Guess(origin, motion=detours))
        found += [passing, extended(task, passing, backend, budget)] if passing.feasible else []
    return found


def extended(task: Task, candidate: Candidate, backend: Backend, budget: Budget) -> Candidate:
    """Return a candidate extended from its end at rest to the demand that it leaves, as far as a motion is found.

    Anytime; a fleet at rest, which would stay there without it, is given one extension in any case.
    """
    moving = np.abs(task.velocity).max() > AT_REST
    for number in range(_EXTENSIONS):
        if budget.exhausted and (number > 0 or moving):
            break
        weight = task.remaining_after(candidate.plan)
        if not (weight > 0.0).any():
            break
        end = candidate.plan
        rest = replace(
            task, weight=weight, position=end.position[-1], velocity=end.velocity[-1], start_time=end.end_time
        )
        more = _extension(rest, backend, budget)
        if more is None:
            break
        candidate = _joined(task, candidate, more)
    return candidate


def _extension(rest: Task, backend: Backend, budget: Budget) -> Candidate | None:
    """Return the best of a tour and a flight in formation that measures some of the demand, or of a search."""
    makers: list[InitialGuess] = [StaggeredTour(budget), FormationFlight(budget)]
    if tight := link_lanes(rest) < 1.0:
        makers.append(Towing())
    found: list[Candidate] = []
    useful: list[Candidate] = []
    for maker in makers:
        if useful and (tight or budget.exhausted):
            break
        for guess in maker.guesses(rest):
            found.append(evaluate_guess(rest, guess))
            budget.charge(GUESS_SAMPLE_S * found[-1].plan.steps)
        useful = [one for one in found if _makes_progress(rest, one)]
    if not useful and found and not budget.exhausted:
        searched = multistart(rest, backend, found[0].plan.steps, _SEARCH, budget)[0]
        useful = [searched] if _makes_progress(rest, searched) else []
    return min(useful, key=lambda one: one.plan.steps / _gain(rest, one), default=None)


def _makes_progress(rest: Task, more: Candidate) -> bool:
    """Return whether a plan is feasible and leaves fewer cells than there were."""
    return more.feasible and _gain(rest, more) > 0


def _gain(rest: Task, more: Candidate) -> int:
    """Return how many demands of cells a plan satisfies."""
    return int(np.count_nonzero(rest.weight)) - int(np.count_nonzero(rest.remaining_after(more.plan)))


def _joined(task: Task, first: Candidate, second: Candidate) -> Candidate:
    velocity = np.concatenate([first.plan.velocity, second.plan.velocity[1:]])
    rests = first.kind is GuessKind.REST
    origin = Origin(second.kind if rests else first.kind, f"{first.origin.name}, then {second.origin.name}")
    whole = evaluate_motion(task, first.plan.position[0], velocity, origin)
    return replace(whole, main=first.main or (None if rests else first.plan))
