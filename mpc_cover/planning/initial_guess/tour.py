"""Greedy tours of scattered cells by several agents; sweeps where there are too many for that."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.planning.initial_guess.boustrophedon import Boustrophedon
from mpc_cover.planning.initial_guess.guess import Guess, GuessKind, Origin

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.task import Task

_COVERED_SHARE = 0.7
"""Part of the sensing radius within which a cell counts as covered from a visited cell; a plain choice below 1 for
tracking between samples."""
_CELLS_MAX = 1500
"""Owed cells up to which a tour is made: beyond, both its computation and its flight take too long. Plain choice."""


class Tour:
    """A greedy tour, unless there are too many cells."""

    def guesses(self, task: Task, incumbent: Trajectory | None = None) -> Iterator[Guess]:  # noqa: ARG002 - from scratch
        """Yield the tour, if there is one."""
        if _few(task.weight):
            yield tour_guess(task.fleet, task.cell, task.weight, task.position)


def tour_or_strips(task: Task) -> Guess:
    """Return a greedy tour of what a task demands; where that is too much, strips of equal work."""
    if _few(task.weight):
        return tour_guess(task.fleet, task.cell, task.weight, task.position)
    return next(Boustrophedon().guesses(task))


def _few(weight: FloatArray) -> bool:
    return bool(np.count_nonzero((weight > 0.0).any(axis=0)) <= _CELLS_MAX)


def tour_guess(fleet: Fleet, cell: FloatArray, demand: FloatArray, position: FloatArray) -> Guess:
    """Return a greedy tour: repeatedly, the agent that can reach some remaining cell first is sent to it.

    It suits few, scattered cells, and leaves what nobody can measure. Arguments as in `boustrophedon.sweep_guesses`.
    """
    measurable = np.asarray(np.isfinite(fleet.radius).any(axis=0))
    owed = (demand[measurable] > 0.0).any(axis=0)
    cell, left = cell[owed], (demand[:, owed] > 0.0) & measurable[:, None]
    paths = [[position[i]] for i in range(fleet.size)]
    clock = np.zeros(fleet.size)
    while left.any():
        able = np.isfinite(fleet.radius) @ left.astype(float) > 0.0  # (m, K)
        here = np.array([path[-1] for path in paths])
        distance = np.linalg.norm(here[:, None] - cell[None], axis=2)
        arrival = np.where(able, clock[:, None] + distance / fleet.speed_max[:, None], np.inf)
        agent, goal = np.unravel_index(int(np.argmin(arrival)), arrival.shape)
        paths[agent].append(cell[goal])
        clock[agent] = arrival[agent, goal]
        near = np.linalg.norm(cell - cell[goal], axis=1)
        covered = near[None] <= _COVERED_SHARE * fleet.radius[agent][:, None]
        covered[:, goal] = np.isfinite(fleet.radius[agent])
        left &= ~covered
    return Guess(Origin(GuessKind.TOUR, "tour"), [np.array(path[1:] or path) for path in paths])
