"""Plans of a given length: several starts of different kinds, the best of them refined."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, islice
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.planning.continuation import SHARPNESS, judge, length_scale, refine, refine_thoroughly
from mpc_cover.planning.deadline import late, part_of
from mpc_cover.planning.guesses import Guess, rest_guess, sweep_guesses, tour_guess
from mpc_cover.planning.task import Candidate, Task, candidate_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.planning.continuation import Refined
    from solvers.backends.base import Backend

COARSE = (2.0, 8.0, 20.0)
"""Stages that tell good starts from bad ones: after them the order of the costs is nearly the final one."""
_FIRST = ("comb", "snake", "strips", "tour")
"""Kinds in the order in which they tend to end well."""
_HOPELESS = 1.5
"""What costs more than this many sensing radii after refinement is not refined again."""
_TOURED = 1500
"""Cells up to which a tour is among the guesses for everything."""
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
    kinds : only these guesses, in this order; empty for all.
    thorough : whether finalists are also refined in several ways from their start.
    exact_cones : second-order cones instead of polytopes, where the back-end has them.
    """

    starts: int = 10
    finalists: int = 2
    seed: int = 0
    kinds: tuple[str, ...] = ()
    thorough: bool = False
    exact_cones: bool = False


def plan_for(
    task: Task, backend: Backend, steps: int, search: Search | None = None, deadline: float | None = None
) -> list[Candidate]:
    """Return plans of exactly `steps` samples, the best first, from several starts; anytime.

    The list holds what became of each start that was tried. `deadline` is on `time.perf_counter`.
    """
    search = search or Search()
    window = task.window(steps)
    screening = part_of(deadline, 0.5)
    tried: list[tuple[Guess, Refined]] = []
    for guess in islice(starts(task, search), max(search.starts, 1)):
        if late(screening) and tried:
            break
        x = window.exact_ends(task.flown(guess, steps).decision)
        coarse = refine(
            window,
            x,
            backend,
            sharpness=COARSE,
            iterations=4,
            deadline=deadline,
            exact_cones=search.exact_cones,
        )
        tried.append((guess, coarse))
        if coarse.cost == 0.0 and coarse.feasible:
            break
    tried.sort(key=lambda item: (not item[1].feasible, item[1].cost))
    found = [candidate_of(task, steps, coarse, guess.kind) for guess, coarse in tried]
    for guess, coarse in tried[: search.finalists]:
        if min(found, key=lambda c: c.rank).complete or late(deadline):
            break
        found.append(_finished(task, backend, steps, (guess, coarse), deadline, search))
    still = task.flown(rest_guess(task.position), steps)
    found.append(candidate_of(task, steps, judge(window, window.exact_ends(still.decision)), "rest"))
    return sorted(found, key=lambda candidate: candidate.rank)


def _finished(
    task: Task,
    backend: Backend,
    steps: int,
    start: tuple[Guess, Refined],
    deadline: float | None,
    search: Search,
) -> Candidate:
    """Refine a finalist from where the coarse stages left it, then once more from the start."""
    guess, coarse = start
    window = task.window(steps)
    exact = search.exact_cones
    refined = partial(refine, window, backend=backend, deadline=deadline, exact_cones=exact)
    fine = refined(x=coarse.x, sharpness=SHARPNESS[2:], iterations=8, region=0.5)
    first = candidate_of(task, steps, fine, guess.kind)
    if first.complete or first.cost > _HOPELESS * length_scale(window) or late(deadline):
        return first
    x = window.exact_ends(task.flown(guess, steps).decision)
    if search.thorough:
        again = refine_thoroughly(window, x, backend, deadline=deadline, exact_cones=exact)
    else:
        again = refined(x=x, iterations=6)
    return min(first, candidate_of(task, steps, again, guess.kind), key=lambda candidate: candidate.rank)


def starts(task: Task, search: Search) -> Iterator[Guess]:
    """Yield guesses: the systematic ones in the order of their promise, then random relatives without end."""
    if not (task.weight > 0.0).any():
        yield rest_guess(task.position)
        return
    sweeps = sweep_guesses(task.fleet, task.cell, task.weight, task.position, task.period)
    few = task.cell.shape[0] <= _TOURED  # a tour of everything is long to make and longer to fly
    tours = [tour_guess(task.fleet, task.cell, task.weight, task.position)] if few else []
    systematic = sorted(chain(sweeps, tours), key=lambda guess: _FIRST.index(guess.kind.split()[0]))
    if search.kinds:
        chosen = {guess.kind: guess for guess in systematic}
        yield from (chosen[kind] for kind in search.kinds if kind in chosen)
        return
    yield from systematic
    rng = np.random.default_rng(search.seed)
    radius = float(task.fleet.radius[np.isfinite(task.fleet.radius)].min())
    number = 0
    while True:
        number += 1
        guess = systematic[int(rng.integers(len(systematic)))]
        moved = [path + rng.normal(scale=_JITTER * radius, size=path.shape) for path in guess.paths]
        inside = [np.clip(path, task.fleet.motion_min, task.fleet.motion_max) for path in moved]
        yield replace(guess, kind=f"{guess.kind}, random {number}", paths=inside)
