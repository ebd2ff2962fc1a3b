"""Plans that take many looks in a single slow pass instead of several laps: sweeps timed by a linear programme.

Each sweep is timed by `dwell_time_lp`, tracked within the limits, and evaluated. Looks that are missing after rounding
to whole samples are added to the programme, which is solved again; the SQP repairs separation and connectivity.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.sensing import look_counts
from mpc_cover.model.tolerances import STEP_ROUNDING
from mpc_cover.planning.basin_hopping import WEIGHT_FACTOR
from mpc_cover.planning.budget import GUESS_SAMPLE_S
from mpc_cover.planning.candidate import evaluate_guess, evaluate_motion, guess_priority
from mpc_cover.planning.initial_guess.boustrophedon import Boustrophedon
from mpc_cover.planning.initial_guess.dwell_time_lp import solve_dwell_times, timed_samples
from mpc_cover.planning.initial_guess.guess import Guess, GuessKind, Origin
from mpc_cover.planning.initial_guess.waypoint_tracking import track_samples
from mpc_cover.planning.segment_refinement import SEGMENT_STEPS, refine_segments

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.candidate import Candidate
    from mpc_cover.planning.task import Task
    from solvers.backends.base import Backend

_PASSES = 4
"""Passes of segment refinement over a plan; a plain choice."""
_WORK_MAX = 2e6
"""Cells times metres of path up to which sweeps are timed: all 18 of a field of 100 m^2, one of 1600 m^2. A plain
choice."""
_REPAIR_SIZE_MAX = 2e7
"""Coordinates of a plan times cells up to which it is repaired: each segment counts the looks of all others. Plain
choice."""
_VIOLATION_COST = 0.1
"""Relative increase of a sweep's length per metre of violation [1/m] where sweeps are ordered; a plain choice."""
_ROUNDS = 4
"""Solutions of the programme per sweep, each with the looks that the one before lacks; a plain choice."""


class TimedSweeps:
    """Sweeps timed by a linear programme, so that every cell gets all the looks that it demands.

    Parameters
    ----------
    most : largest number of sweeps; None for all.
    """

    def __init__(self, most: int | None = None) -> None:
        self._most = most

    def guesses(self, task: Task, incumbent: Trajectory | None = None) -> Iterator[Guess]:  # noqa: ARG002 - from scratch
        """Yield motions of each sweep in turn, each timed for the looks that the one before lacks.

        For tasks with several looks, a given initial state and an end at rest.
        """
        work = 0.0
        sweeps = sorted(Boustrophedon(slow=True).guesses(task), key=lambda guess: guess.origin.kind is GuessKind.STRIPS)
        for guess in islice(sweeps, self._most):
            if work > _WORK_MAX:
                return
            work += task.cell.shape[0] * sum(_length(path) for path in guess.paths)
            origin = Origin(GuessKind.TIMED_SWEEP, f"slow {guess.origin.name}")
            for motion in _timed_motions(task, guess):
                yield Guess(origin, motion=motion)


def timed_sweeps(task: Task, most: int | None, budget: Budget) -> list[Candidate]:
    """Return the candidates of up to `most` timed sweeps (None: all), as the budget allows, but at least one."""
    found: list[Candidate] = []
    for guess in TimedSweeps(most).guesses(task):
        found.append(evaluate_guess(task, guess))
        budget.charge(GUESS_SAMPLE_S * found[-1].plan.steps)
        if budget.exhausted:
            break
    return found


def _length(path: FloatArray) -> float:
    """Return the length of a path with (W, d) waypoints [m]."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def repair_sweeps(task: Task, sweeps: list[Candidate], backend: Backend, most: int, budget: Budget) -> list[Candidate]:
    """Return the up to `most` most promising sweeps, repaired and shortened by the SQP."""
    found: list[Candidate] = []
    for guess in sorted(sweeps, key=partial(guess_priority, violation_cost=_VIOLATION_COST))[:most]:
        if budget.exhausted or guess.plan.position.size * task.cell.shape[0] > _REPAIR_SIZE_MAX:
            break
        found.append(_refined(task, guess, backend, budget))
    return found


def _refined(task: Task, guess: Candidate, backend: Backend, budget: Budget) -> Candidate:
    """Refine a plan segment by segment; cells that one pass leaves weigh more in the next."""
    best, weight = guess, task.weight
    position, velocity = guess.plan.position, guess.plan.velocity
    for _ in range(_PASSES):
        if budget.exhausted:
            break
        heavier = replace(task, weight=weight)
        position, velocity = refine_segments(
            heavier, (position, velocity), backend, length=SEGMENT_STEPS, passes=1, budget=budget
        )
        candidate = evaluate_motion(task, position[0], velocity, guess.origin)
        best = min(best, candidate, key=lambda one: one.rank)
        weight = np.where(task.remaining_after(candidate.plan) > 0.0, WEIGHT_FACTOR * weight, weight)
    return best


def _timed_motions(task: Task, guess: Guess) -> Iterator[Trajectory]:
    """Yield the motions of a sweep, each timed for the looks that the one before lacks."""
    assert task.looks is not None
    paths = [np.concatenate([here[None], path]) for here, path in zip(task.position, guess.paths, strict=True)]
    required = np.where(task.weight > 0.0, task.looks, 0).astype(float)
    demanded = required.copy()
    for _ in range(_ROUNDS):
        found = solve_dwell_times(paths, task.fleet, task.cell, demanded, task.period)
        if found is None:
            return
        steps = int(np.ceil(max(float(samples.sum()) for samples in found.samples) - STEP_ROUNDING)) + 1
        motion = track_samples(
            timed_samples(found, steps), task.position, task.velocity, task.fleet, task.period, task.start_time
        )
        yield motion
        lacking = np.maximum(required - look_counts(motion.position, task.cell, task.fleet.radius), 0.0)
        if not lacking.any():
            return
        demanded = np.where(lacking > 0.0, demanded + lacking, demanded)
