"""Multi-start planning over a given horizon: several initial guesses, the best of them refined."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, islice
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from mpc_cover.planning.basin_hopping import basin_hopping, reweighted
from mpc_cover.planning.budget import GUESS_SAMPLE_S, Budget
from mpc_cover.planning.candidate import Candidate, candidate_of
from mpc_cover.planning.initial_guess.boustrophedon import Boustrophedon
from mpc_cover.planning.initial_guess.cruise import at_cruise
from mpc_cover.planning.initial_guess.formation_sweeps import FormationSweeps
from mpc_cover.planning.initial_guess.guess import GuessKind, Origin, rest_guess
from mpc_cover.planning.initial_guess.path_comparison import shorter
from mpc_cover.planning.initial_guess.shape_tour import ShapeTour
from mpc_cover.planning.initial_guess.tour import Tour
from mpc_cover.planning.scp import (
    REFINEMENT_REGION,
    SHARPNESS,
    SOFT_SHARPNESS,
    descends_natively,
    evaluate,
    length_scale,
    optimise,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from mpc_cover.arrays import FloatArray
    from mpc_cover.planning.initial_guess.guess import Guess
    from mpc_cover.planning.initial_guess.interface import InitialGuess
    from mpc_cover.planning.scp import SCPResult
    from mpc_cover.planning.task import Task
    from solvers.backends.base import Backend

    Progress = Callable[[int, Candidate], None]

COARSE = (4.0, 10.0, 30.0)
"""Sharpness of the stages that screen the starts: after them the order of costs was observed to be nearly final."""
_COARSE_ITERATIONS, _FINE_ITERATIONS = 4, 8
"""QPs per stage of screening and of refining; plain choices."""
_FINE = SHARPNESS[2:]
"""Sharpness of the stages that refine a screened start: the last two of the continuation."""
_SCREENING_SHARE = 0.5
"""Part of the budget in which starts are generated; a plain choice."""
_KIND_ORDER = (GuessKind.FORMATION, GuessKind.COMB, GuessKind.SNAKE, GuessKind.STRIPS, GuessKind.TOUR, GuessKind.REST)
"""Kinds of guesses in the order in which they tend to end well, as observed."""
_REFINE_AGAIN_COST = 1.5
"""Cost in sensing radii above which a refined plan is not refined once more from its guess; a plain choice."""
_JITTER = 0.35
"""Standard deviation of random starts' waypoints around those of systematic ones, in sensing radii; plain choice."""


@dataclass(frozen=True)
class Search:
    """The extent of a search.

    Attributes
    ----------
    starts : guesses that coarse stages screen; beyond the systematic ones they are random.
    finalists : the best of them, refined until one is complete.
    seed : of the random guesses and hops.
    names : only these guesses, in this order; empty for all.
    rounds : basin hops from the best finalist while it is incomplete; None for as many as the budget allows.
    exact_cones : second-order cones instead of polytopes, where the back-end has them.
    """

    starts: int = 10
    finalists: int = 2
    seed: int = 0
    names: tuple[str, ...] = ()
    rounds: int | None = 0
    exact_cones: bool = False


def multistart(
    task: Task,
    backend: Backend,
    steps: int,
    search: Search,
    budget: Budget,
    on_progress: Progress | None = None,
    given: Mapping[str, FloatArray] | None = None,
    known: Mapping[str, FloatArray] | None = None,
) -> list[Candidate]:
    """Return plans of exactly `steps` samples, the best first, from several starts; anytime.

    The list holds one candidate per start tried. `on_progress` is called with the length and each better plan. `given`
    maps names to decision vectors of `task.ocp(steps)` that replace the initial guesses, `known` those that come first.
    """
    notify = on_progress or _ignore
    ocp = task.ocp(steps)
    screening = budget.part(_SCREENING_SHARE)
    natively = descends_natively(ocp, backend, exact_cones=search.exact_cones)
    tried: list[tuple[Origin, FloatArray, SCPResult]] = []
    starts = _starts(task, steps, search, screening) if given is None else _given(given)
    for origin, x in chain(_given(known or {}), starts):
        coarse = optimise(
            ocp,
            x,
            backend,
            sharpness=SOFT_SHARPNESS if natively else COARSE,
            iterations=_COARSE_ITERATIONS,
            budget=budget,
            exact_cones=search.exact_cones,
        )
        tried.append((origin, x, coarse))
        if coarse.complete:
            break
    tried.sort(key=lambda item: (not item[2].feasible, item[2].merit))
    found = [candidate_of(task, steps, coarse, origin) for origin, _, coarse in tried]
    for finalist in tried[: search.finalists]:
        if min(found, key=lambda c: c.rank).complete or budget.exhausted:
            break
        found.append(_refined(task, backend, steps, finalist, budget, search))
    best = min(found, key=lambda candidate: candidate.rank)
    notify(steps, best)
    resting = rest_guess(task.position)
    rest = ocp.decision_of(task.flown(resting, steps))
    if not best.complete and search.rounds != 0:
        found.append(_hopped(task, backend, best, [rest, *(x for _, x, _ in tried)], budget, search, notify))
    found.append(candidate_of(task, steps, evaluate(ocp, rest), resting.origin))
    return sorted(found, key=lambda candidate: candidate.rank)


def _refined(
    task: Task,
    backend: Backend,
    steps: int,
    finalist: tuple[Origin, FloatArray, SCPResult],
    budget: Budget,
    search: Search,
) -> Candidate:
    """Refine a finalist from the result of the coarse stages, then once more from its guess."""
    origin, x, coarse = finalist
    ocp = task.ocp(steps)
    exact = search.exact_cones
    refined = partial(optimise, ocp, backend=backend, budget=budget, exact_cones=exact)
    fine = refined(x=coarse.x, sharpness=_FINE, iterations=_FINE_ITERATIONS, region=REFINEMENT_REGION)
    first = candidate_of(task, steps, fine, origin)
    if first.complete or first.cost > _REFINE_AGAIN_COST * length_scale(ocp) or budget.exhausted:
        return first
    again = refined(x=x)
    return min(first, candidate_of(task, steps, again, origin), key=lambda candidate: candidate.rank)


def _hopped(
    task: Task,
    backend: Backend,
    best: Candidate,
    guesses: list[FloatArray],
    budget: Budget,
    search: Search,
    notify: Progress,
) -> Candidate:
    """Leave the local minimum of the best plan by reweighting and basin hopping."""
    steps = best.plan.steps
    ocp = task.ocp(steps)
    if best.refined is None:
        return best
    exact = search.exact_cones
    improved = reweighted(ocp, best.refined, backend, budget=budget, exact_cones=exact)
    found = basin_hopping(
        ocp,
        improved,
        backend,
        rounds=search.rounds,
        guesses=guesses,
        seed=search.seed,
        budget=budget,
        exact_cones=exact,
        on_progress=lambda refined: notify(steps, candidate_of(task, steps, refined, best.origin)),
    )
    return candidate_of(task, steps, found, best.origin)


def _starts(task: Task, steps: int, search: Search, budget: Budget) -> Iterator[tuple[Origin, FloatArray]]:
    """Yield origins and decision vectors of up to `search.starts` initial guesses, as the budget allows."""
    ocp = task.ocp(steps)
    for number, guess in enumerate(islice(initial_guesses(task, search, budget), max(search.starts, 1))):
        if number and budget.exhausted:
            return
        budget.charge(GUESS_SAMPLE_S * steps)
        yield guess.origin, ocp.decision_of(task.flown(guess, steps))


def _given(decisions: Mapping[str, FloatArray]) -> Iterator[tuple[Origin, FloatArray]]:
    return ((Origin(GuessKind.GIVEN, name), x) for name, x in decisions.items())


def _ignore(steps: int, candidate: Candidate) -> None:
    """Do nothing on progress."""
    del steps, candidate


def systematic_guesses(task: Task, budget: Budget | None = None) -> list[Guess]:
    """Return all guesses that are neither random nor from an earlier plan, the most promising kinds first.

    Paths along the shape come first where they are much shorter than sweeps; last, where they need a longer range than
    there is; and not at all elsewhere. With a budget, those of large areas that are made in time; at least one is.
    """
    known = _GUESSES.get(task)
    if known is None:
        known = _GUESSES[task] = _made(task, budget or Budget.unlimited())
    return known


_GUESSES: WeakKeyDictionary[Task, list[Guess]] = WeakKeyDictionary()
"""The systematic guesses of tasks that are being planned: several searches begin with them."""


def _made(task: Task, budget: Budget) -> list[Guess]:
    if not (task.weight > 0.0).any():
        return [rest_guess(task.position)]
    free: tuple[InitialGuess, ...] = (Boustrophedon(), Tour())
    guesses = (guess for maker in free for guess in maker.guesses(task))
    together = list(_in_time(FormationSweeps().guesses(task), budget))
    sweeps = sorted(_in_time(at_cruise(task, guesses), budget, least=0 if together else 1), key=_kind_rank)
    first, last = shorter(task, _in_time(ShapeTour().guesses(task), budget), sweeps)
    return [*together, *first, *sweeps, *last]


def _in_time(guesses: Iterator[Guess], budget: Budget, least: int = 0) -> Iterator[Guess]:
    """Yield `least` guesses, and more while the budget lasts."""
    yield from islice(guesses, least)
    while not budget.exhausted and (guess := next(guesses, None)) is not None:
        yield guess


def _kind_rank(guess: Guess) -> int:
    return _KIND_ORDER.index(guess.origin.kind)


def initial_guesses(task: Task, search: Search, budget: Budget | None = None) -> Iterator[Guess]:
    """Yield the systematic guesses, made within a budget, then random perturbations of them without end."""
    systematic = systematic_guesses(task, budget)
    if search.names:
        chosen = {guess.origin.name: guess for guess in systematic}
        yield from (chosen[name] for name in search.names if name in chosen)
        return
    yield from systematic
    rng = np.random.default_rng(search.seed)
    radius = task.fleet.sensing_radius_min
    number, with_paths = 0, [guess for guess in systematic if guess.motion is None]
    while (task.weight > 0.0).any():
        number += 1
        guess = with_paths[int(rng.integers(len(with_paths)))]
        moved = [path + rng.normal(scale=_JITTER * radius, size=path.shape) for path in guess.paths]
        inside = [np.clip(path, task.fleet.motion_min, task.fleet.motion_max) for path in moved]
        yield replace(guess, origin=guess.origin._replace(name=f"{guess.origin.name}, random {number}"), paths=inside)
