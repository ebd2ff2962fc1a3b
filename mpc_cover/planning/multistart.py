"""Plans of a given length: several starts of different kinds, the best of them refined."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.planning.basin_hopping import basin_hopping, reweighted
from mpc_cover.planning.budget import FLIGHT_S
from mpc_cover.planning.candidate import Candidate, candidate_of
from mpc_cover.planning.initial_guess.boustrophedon import Boustrophedon
from mpc_cover.planning.initial_guess.guess import GuessKind, Origin, rest_guess
from mpc_cover.planning.initial_guess.tour import Tour
from mpc_cover.planning.scp import SHARPNESS, evaluate, length_scale, optimise

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from mpc_cover.arrays import FloatArray
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.initial_guess.guess import Guess
    from mpc_cover.planning.initial_guess.interface import InitialGuess
    from mpc_cover.planning.scp import SCPResult
    from mpc_cover.planning.task import Task
    from solvers.backends.base import Backend

    Told = Callable[[int, Candidate], None]

COARSE = (4.0, 10.0, 30.0)
"""Stages that tell good starts from bad ones: after them the order of the costs is nearly the final one."""
_FIRST = (GuessKind.COMB, GuessKind.SNAKE, GuessKind.STRIPS, GuessKind.TOUR, GuessKind.REST)
"""Kinds in the order in which they tend to end well."""
_HOPELESS = 1.5
"""What costs more than this many sensing radii after refinement is not refined again."""
_JITTER = 0.35
"""Random starts move the waypoints of others by this part of the sensing radius."""


@dataclass(frozen=True)
class Search:
    """How much to search.

    Attributes
    ----------
    starts : guesses that are told apart by coarse stages; beyond the systematic ones they are random.
    finalists : the best of them, refined until one covers everything.
    seed : of the random ones.
    names : only these guesses, in this order; empty for all.
    rounds : hops from the best finalist while it leaves something over; None for as many as there is time for.
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
    on_progress: Told | None = None,
    given: Mapping[str, FloatArray] | None = None,
) -> list[Candidate]:
    """Return plans of exactly `steps` samples, the best first, from several starts; anytime.

    The list holds one candidate per start tried. `on_progress` is called with the length and each better plan. `given`
    maps names to decision vectors of `task.ocp(steps)` that replace the initial guesses.
    """
    tell = on_progress or _nobody
    ocp = task.ocp(steps)
    screening = budget.part(0.5)
    tried: list[tuple[Origin, FloatArray, SCPResult]] = []
    for origin, x in _starts(task, steps, search, screening) if given is None else _given(given):
        coarse = optimise(
            ocp,
            x,
            backend,
            sharpness=COARSE,
            iterations=4,
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
        found.append(_finished(task, backend, steps, finalist, budget, search))
    best = min(found, key=lambda candidate: candidate.rank)
    tell(steps, best)
    resting = rest_guess(task.position)
    still = ocp.decision_of(task.flown(resting, steps))
    if not best.complete and search.rounds != 0:
        found.append(_hopped(task, backend, best, [still, *(x for _, x, _ in tried)], budget, search, tell))
    found.append(candidate_of(task, steps, evaluate(ocp, still), resting.origin))
    return sorted(found, key=lambda candidate: candidate.rank)


def _finished(
    task: Task,
    backend: Backend,
    steps: int,
    finalist: tuple[Origin, FloatArray, SCPResult],
    budget: Budget,
    search: Search,
) -> Candidate:
    """Refine a finalist from where the coarse stages left it, then once more from the start."""
    origin, x, coarse = finalist
    ocp = task.ocp(steps)
    exact = search.exact_cones
    refined = partial(optimise, ocp, backend=backend, budget=budget, exact_cones=exact)
    fine = refined(x=coarse.x, sharpness=SHARPNESS[2:], iterations=8, region=0.5)
    first = candidate_of(task, steps, fine, origin)
    if first.complete or first.cost > _HOPELESS * length_scale(ocp) or budget.exhausted:
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
    tell: Told,
) -> Candidate:
    """Leave the local minimum that the best plan is in."""
    steps = best.plan.steps
    ocp = task.ocp(steps)
    if best.refined is None:
        return best
    exact = search.exact_cones
    pushed = reweighted(ocp, best.refined, backend, budget=budget, exact_cones=exact)
    found = basin_hopping(
        ocp,
        pushed,
        backend,
        rounds=search.rounds,
        guesses=guesses,
        seed=search.seed,
        budget=budget,
        exact_cones=exact,
        on_progress=lambda refined: tell(steps, candidate_of(task, steps, refined, best.origin)),
    )
    return candidate_of(task, steps, found, best.origin)


def _starts(task: Task, steps: int, search: Search, until: Budget) -> Iterator[tuple[Origin, FloatArray]]:
    """Yield the origins and decision vectors of guesses as they fly, as many as are to be told apart by then."""
    ocp = task.ocp(steps)
    for number, guess in enumerate(islice(initial_guesses(task, search), max(search.starts, 1))):
        if number and until.exhausted:
            return
        until.charge(FLIGHT_S * steps)
        yield guess.origin, ocp.decision_of(task.flown(guess, steps))


def _given(decisions: Mapping[str, FloatArray]) -> Iterator[tuple[Origin, FloatArray]]:
    return ((Origin(GuessKind.GIVEN, name), x) for name, x in decisions.items())


def _nobody(steps: int, candidate: Candidate) -> None:
    """Hear nothing."""
    del steps, candidate


def systematic_guesses(task: Task) -> list[Guess]:
    """Return all guesses from scratch that are not random, in the order of their promise."""
    if not (task.weight > 0.0).any():
        return [rest_guess(task.position)]
    makers: tuple[InitialGuess, ...] = (Boustrophedon(), Tour())
    return sorted((guess for maker in makers for guess in maker.guesses(task)), key=_promise)


def _promise(guess: Guess) -> int:
    return _FIRST.index(guess.origin.kind)


def initial_guesses(task: Task, search: Search) -> Iterator[Guess]:
    """Yield guesses: the systematic ones in the order of their promise, then random relatives without end."""
    systematic = systematic_guesses(task)
    if search.names:
        chosen = {guess.origin.name: guess for guess in systematic}
        yield from (chosen[name] for name in search.names if name in chosen)
        return
    yield from systematic
    rng = np.random.default_rng(search.seed)
    radius = float(task.fleet.radius[np.isfinite(task.fleet.radius)].min())
    number = 0
    while (task.weight > 0.0).any():
        number += 1
        guess = systematic[int(rng.integers(len(systematic)))]
        moved = [path + rng.normal(scale=_JITTER * radius, size=path.shape) for path in guess.paths]
        inside = [np.clip(path, task.fleet.motion_min, task.fleet.motion_max) for path in moved]
        yield replace(guess, origin=guess.origin._replace(name=f"{guess.origin.name}, random {number}"), paths=inside)
