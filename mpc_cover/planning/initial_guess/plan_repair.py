"""Plan repair after a fault: the remaining agents continue along the paths of the earlier plan.

A plan from scratch takes longer than one step has. The earlier paths still cover what they were planned for, at any
speed; a tour of the cells that lost agents leave is appended.
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
"""Samples of the earlier plan from one waypoint to the next; a plain choice."""


class PlanRepair:
    """Guesses from an earlier plan: each agent at its own top speed, or all at that of the slowest.

    At a common speed the distances between agents remain nearly those of the earlier plan.
    """

    def guesses(self, task: Task, incumbent: Trajectory | None = None) -> Iterator[Guess]:
        """Yield motions from the task's initial state along the incumbent's paths and a tour of the remaining cells."""
        if incumbent is None:
            return
        slowest = float(task.fleet.speed_max[list(task.fleet.active)].min())
        common = replace(task.fleet, speed_max=np.full(task.fleet.size, slowest))
        for name, fleet in (("as before", task.fleet), ("as before, at one speed", common)):
            yield Guess(Origin(GuessKind.REPAIR, name), motion=_tracked(task, incumbent, fleet))


def _tracked(task: Task, earlier: Trajectory, fleet: FleetConstraints) -> Trajectory:
    """Return the motion along the earlier paths with the limits of `fleet`, no wider than the task's own."""
    done = min(max(round((task.start_time - earlier.start_time) / earlier.period), 0), earlier.steps)
    every = _EVERY * max(1, round(task.period / earlier.period))
    ahead = np.concatenate([earlier.position[done:-1:every], earlier.position[-1:]])
    ahead[:, task.fleet.lost] = task.position[list(task.fleet.lost)]
    paths = list(ahead.swapaxes(0, 1))
    limited = replace(task, fleet=fleet)
    origin = Origin(GuessKind.REPAIR, "as before")
    motion = limited.flown(Guess(origin, paths), None)
    left = task.remaining_after(motion)
    if not (left > 0.0).any():
        return motion
    tour = tour_guess(task.fleet, task.cell, left, motion.position[-1])
    further = [np.concatenate(both) for both in zip(paths, tour.paths, strict=True)]
    return limited.flown(Guess(origin, further), None)
