"""What is left of a mission plan after a fault: everyone who can goes on along the ways that it had.

A plan from scratch takes longer than a step has. The old ways cover what they were to cover, at whatever speed they
are flown; what the lost leave over is added at the end.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.planning.initial_guess.boustrophedon import Guess, tour_guess
from mpc_cover.planning.task import as_flown

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.task import Candidate, Task

_EVERY = 2
"""Samples of the old plan from one waypoint to the next."""


def repaired_plan(task: Task, old: Trajectory) -> Candidate:
    """Return the best candidate that flies the ways of an old plan from the task's start, then to what is left over.

    Each as fast as it can, or all as fast as the slowest: then they stay as near to each other as they were.
    """
    slowest = float(task.fleet.speed_max[list(task.fleet.active)].min())
    even = replace(task.fleet, speed_max=np.full(task.fleet.size, slowest))
    found = [_with_the_rest(task, old, fleet) for fleet in (task.fleet, even)]
    return min(found, key=lambda candidate: candidate.rank)


def _with_the_rest(task: Task, old: Trajectory, fleet: Fleet) -> Candidate:
    """Fly the old ways with the limits of `fleet`, which are no wider than the task's own."""
    done = min(max(round((task.start_time - old.start_time) / task.period), 0), old.steps)
    ahead = np.concatenate([old.position[done:-1:_EVERY], old.position[-1:]])
    ahead[:, task.fleet.lost] = task.position[list(task.fleet.lost)]
    paths = list(ahead.swapaxes(0, 1))
    candidate = _flown(task, paths, fleet)
    left = task.owed_after(candidate.plan)
    if not (left > 0.0).any():
        return candidate
    tour = tour_guess(task.fleet, task.cell, left, candidate.plan.position[-1])
    return _flown(task, [np.concatenate(ways) for ways in zip(paths, tour.paths, strict=True)], fleet)


def _flown(task: Task, paths: list[FloatArray], fleet: Fleet) -> Candidate:
    guess = Guess("the ways as before", paths)
    return as_flown(task, guess, replace(task, fleet=fleet).flown(guess, None))
