"""What is left of a mission plan after a fault: everyone who can goes on along the ways that it had.

A plan from scratch takes longer than a step has. The old ways cover what they were to cover, at whatever speed they
are flown; what the lost leave over is added at the end.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.planning.initial_guess.guess import Guess, GuessKind, Origin
from mpc_cover.planning.initial_guess.tour import tour_guess

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.model.fleet_constraints import FleetConstraints
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.task import Task

_EVERY = 2
"""Samples of the old plan from one waypoint to the next."""


class PlanRepair:
    """Guesses from an earlier plan: each as fast as it can, or all as fast as the slowest.

    In the second everyone stays as near to the others as it was.
    """

    def guesses(self, task: Task, incumbent: Trajectory | None = None) -> Iterator[Guess]:
        """Yield motions that fly the ways of the incumbent from the task's start, then to what is left over."""
        if incumbent is None:
            return
        slowest = float(task.fleet.speed_max[list(task.fleet.active)].min())
        even = replace(task.fleet, speed_max=np.full(task.fleet.size, slowest))
        for name, fleet in (("as before", task.fleet), ("as before, at one speed", even)):
            yield Guess(Origin(GuessKind.REPAIR, name), motion=_flown(task, incumbent, fleet))


def _flown(task: Task, old: Trajectory, fleet: FleetConstraints) -> Trajectory:
    """Fly the old ways with the limits of `fleet`, which are no wider than the task's own."""
    done = min(max(round((task.start_time - old.start_time) / task.period), 0), old.steps)
    ahead = np.concatenate([old.position[done:-1:_EVERY], old.position[-1:]])
    ahead[:, task.fleet.lost] = task.position[list(task.fleet.lost)]
    paths = list(ahead.swapaxes(0, 1))
    tracked = replace(task, fleet=fleet)
    origin = Origin(GuessKind.REPAIR, "as before")
    motion = tracked.flown(Guess(origin, paths), None)
    left = task.remaining_after(motion)
    if not (left > 0.0).any():
        return motion
    tour = tour_guess(task.fleet, task.cell, left, motion.position[-1])
    further = [np.concatenate(ways) for ways in zip(paths, tour.paths, strict=True)]
    return tracked.flown(Guess(origin, further), None)
