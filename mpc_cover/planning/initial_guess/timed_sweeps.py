"""Plans that bring several looks at once: sweeps flown as slowly as it takes, instead of again and again.

Each guess is timed by a linear programme (`dwelling`), flown within the limits, and judged. What whole samples lack
is asked for once more of the programme; what breaks separation or connectivity is left to the SQP.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.sensing import look_counts
from mpc_cover.planning.budget import FLIGHT_S
from mpc_cover.planning.candidate import evaluate_guess, evaluate_motion, guess_priority
from mpc_cover.planning.initial_guess.boustrophedon import Boustrophedon
from mpc_cover.planning.initial_guess.dwell_time_lp import solve_dwell_times, timed_samples
from mpc_cover.planning.initial_guess.guess import Guess, GuessKind, Origin
from mpc_cover.planning.initial_guess.waypoint_tracking import track_samples
from mpc_cover.planning.segment_refinement import refine_segments

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.candidate import Candidate
    from mpc_cover.planning.task import Task
    from solvers.backends.base import Backend

_STRETCH, _PASSES = 24, 4
"""Samples of a stretch that is mended, and passes over a plan."""
_MOST_WORK = 2e6
"""Cells times metres of path up to which one guess after another is timed: 18 of 100 m^2, one of 1600 m^2."""
_MENDABLE = 2e7
"""Coordinates of a plan times cells up to which it is mended: every stretch counts all looks of the others."""
_REPAIR = 0.1
"""What a metre of violation adds to the time that a guess promises, as a part of it."""
_KICK = 4.0
"""By how much what a pass leaves over weighs more in the next."""
_ROUNDS = 4
"""How often the programme is asked again for what whole samples lack."""


class TimedSweeps:
    """Sweeps that are timed by a linear programme, so that every cell gets all the looks it is owed.

    Parameters
    ----------
    most : sweeps at the most; None for all.
    """

    def __init__(self, most: int | None = None) -> None:
        self._most = most

    def guesses(self, task: Task, incumbent: Trajectory | None = None) -> Iterator[Guess]:  # noqa: ARG002 - from scratch
        """Yield motions of each sweep in turn, the next timed for what the one before lacks.

        For tasks of several looks from a given start to rest.
        """
        work = 0.0
        sweeps = sorted(Boustrophedon(slow=True).guesses(task), key=lambda guess: guess.origin.kind is GuessKind.STRIPS)
        for guess in islice(sweeps, self._most):
            if work > _MOST_WORK:
                return
            work += task.cell.shape[0] * sum(_length(path) for path in guess.paths)
            origin = Origin(GuessKind.TIMED_SWEEP, f"slow {guess.origin.name}")
            for motion in _flown(task, guess):
                yield Guess(origin, motion=motion)


def timed_sweeps(task: Task, most: int | None, budget: Budget) -> list[Candidate]:
    """Return what up to `most` timed sweeps come to (None: all), judged; one at the least, whatever the budget."""
    found: list[Candidate] = []
    for guess in TimedSweeps(most).guesses(task):
        found.append(evaluate_guess(task, guess))
        budget.charge(FLIGHT_S * found[-1].plan.steps)
        if budget.exhausted:
            break
    return found


def _length(path: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def repair_sweeps(task: Task, flown: list[Candidate], backend: Backend, most: int, budget: Budget) -> list[Candidate]:
    """Return what becomes of the `most` promising of some plans when they are repaired and shortened by the SQP."""
    found: list[Candidate] = []
    for guess in sorted(flown, key=partial(guess_priority, repair=_REPAIR))[:most]:
        if budget.exhausted or guess.plan.position.size * task.cell.shape[0] > _MENDABLE:
            break
        found.append(_mended(task, guess, backend, budget))
    return found


def _mended(task: Task, guess: Candidate, backend: Backend, budget: Budget) -> Candidate:
    """Go over a plan stretch by stretch; what a pass leaves over weighs more in the next."""
    best, weight = guess, task.weight
    position, velocity = guess.plan.position, guess.plan.velocity
    for _ in range(_PASSES):
        if budget.exhausted:
            break
        heavier = replace(task, weight=weight)
        position, velocity = refine_segments(
            heavier, (position, velocity), backend, length=_STRETCH, passes=1, budget=budget
        )
        candidate = evaluate_motion(task, position[0], velocity, guess.origin)
        best = min(best, candidate, key=lambda one: one.rank)
        weight = np.where(task.remaining_after(candidate.plan) > 0.0, _KICK * weight, weight)
    return best


def _flown(task: Task, guess: Guess) -> Iterator[Trajectory]:
    """Yield the motions of a guess, each timed for what the one before lacks."""
    assert task.looks is not None
    paths = [np.concatenate([here[None], path]) for here, path in zip(task.position, guess.paths, strict=True)]
    owed = np.where(task.weight > 0.0, task.looks, 0).astype(float)
    asked = owed.copy()
    for _ in range(_ROUNDS):
        found = solve_dwell_times(paths, task.fleet, task.cell, asked, task.period)
        if found is None:
            return
        steps = int(np.ceil(max(float(samples.sum()) for samples in found.samples) - 1e-9)) + 1
        motion = track_samples(
            timed_samples(found, steps), task.position, task.velocity, task.fleet, task.period, task.start_time
        )
        yield motion
        lacking = np.maximum(owed - look_counts(motion.position, task.cell, task.fleet.radius), 0.0)
        if not lacking.any():
            return
        asked = np.where(lacking > 0.0, asked + lacking, asked)
