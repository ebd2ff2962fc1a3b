"""Plan repair after a fault: the remaining agents continue along the paths of the earlier plan.

A plan from scratch takes longer than one step has. The earlier paths still cover what they were planned for, at any
speed; the cells that lost agents leave are inserted as detours, or a tour of them is appended.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.planning.initial_guess.cell_insertion import REACH_SHARES, with_cells
from mpc_cover.planning.initial_guess.guess import Guess, GuessKind, Origin
from mpc_cover.planning.initial_guess.tour import tour_guess

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.task import Task

_EVERY = 2
"""Samples of the earlier plan from one waypoint to the next; a plain choice."""


class PlanRepair:
    """Guesses from an earlier plan: each agent at its own top speed, or all at that of the slowest.

    At a common speed the distances between agents remain nearly those of the earlier plan. Cells that are left then are
    inserted as detours, or a tour of them is appended.
    """

    def guesses(self, task: Task, incumbent: Trajectory | None = None) -> Iterator[Guess]:
        """Yield motions from the task's initial state along the incumbent's paths and to the remaining cells."""
        if incumbent is None:
            return
        slowest = float(task.fleet.speed_max[list(task.fleet.active)].min())
        common = replace(task.fleet, speed_max=np.full(task.fleet.size, slowest))
        paths = _paths_ahead(task, incumbent)
        for name, fleet in (("as before", task.fleet), ("as before, at one speed", common)):
            limited = replace(task, fleet=fleet)
            motion = _flown(limited, paths)
            if not (task.remaining_after(motion) > 0.0).any():
                yield Guess(Origin(GuessKind.REPAIR, name), motion=motion)
                continue
            detours = motion_with_detours(limited, motion, paths)
            for further in (detours, _with_tour(limited, motion, paths)):
                if further is not None:
                    yield Guess(Origin(GuessKind.REPAIR, name), motion=further)


def waypoints_of(plan: Trajectory, begin: int = 0, parts: int = 1) -> list[FloatArray]:
    """Return each agent's waypoints (W, d) [m]: every other step of a plan from sample `begin` on, and its end.

    A step is `parts` samples.
    """
    ahead = np.concatenate([plan.position[begin : -1 : _EVERY * parts], plan.position[-1:]])
    return list(ahead.swapaxes(0, 1))


def motion_with_detours(task: Task, motion: Trajectory, paths: list[FloatArray]) -> Trajectory | None:
    """Return a motion along the paths of a `motion` with detours to the cells that it leaves; None if that takes none.

    Tracking may leave cells all the same, which are inserted in turn.
    """
    best, before = None, int(np.count_nonzero(task.remaining_after(motion)))
    for share in REACH_SHARES:
        left = task.remaining_after(motion)
        further = with_cells(paths, task.cell, left, task.fleet, share)
        if further is None:
            break
        paths, motion = further, _flown(task, further)
        rest = int(np.count_nonzero(task.remaining_after(motion)))
        if rest < before:
            best, before = motion, rest
        if not rest:
            break
    return best


def _paths_ahead(task: Task, earlier: Trajectory) -> list[FloatArray]:
    """Return the waypoints of what an earlier plan had still to fly; lost agents stay."""
    done = min(max(round((task.start_time - earlier.start_time) / earlier.period), 0), earlier.steps)
    paths = waypoints_of(earlier, done, max(1, round(task.period / earlier.period)))
    for agent in task.fleet.lost:
        paths[agent] = task.position[agent][None]
    return paths


def _flown(task: Task, paths: list[FloatArray]) -> Trajectory:
    return task.flown(Guess(Origin(GuessKind.REPAIR, "as before"), paths), None)


def _with_tour(task: Task, motion: Trajectory, paths: list[FloatArray]) -> Trajectory:
    """Return the motion along the paths, and then along a tour of the cells that are left."""
    left = task.remaining_after(motion)
    tour = tour_guess(task.fleet, task.cell, left, motion.position[-1])
    return _flown(task, [np.concatenate(both) for both in zip(paths, tour.paths, strict=True)])
