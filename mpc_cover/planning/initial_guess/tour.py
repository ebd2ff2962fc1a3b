"""Greedy tours of scattered cells."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.planning.initial_guess.guess import Guess, GuessKind, Origin

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.task import Task

_SEEN = 0.7
"""Part of the radius within which a cell counts as seen from a cell that is visited."""
_MOST_CELLS = 1500
"""Cells up to which a tour is made: one of everything is long to make and longer to fly."""


class Tour:
    """A greedy tour, where there are not too many cells."""

    def guesses(self, task: Task, incumbent: Trajectory | None = None) -> Iterator[Guess]:  # noqa: ARG002 - from scratch
        """Yield the tour, if it is worth making."""
        if task.cell.shape[0] <= _MOST_CELLS:
            yield tour_guess(task.fleet, task.cell, task.weight, task.position)


def tour_guess(fleet: Fleet, cell: FloatArray, owed: FloatArray, position: FloatArray) -> Guess:
    """Return a greedy tour: again and again the agent that can be first at a cell takes it.

    Made for what is left over: few, scattered cells. Arguments as in `boustrophedon.sweep_guesses`.
    """
    left = owed > 0.0
    paths = [[position[i]] for i in range(fleet.size)]
    clock = np.zeros(fleet.size)
    while left.any():
        able = np.isfinite(fleet.radius) @ left.astype(float) > 0.0  # (m, K)
        here = np.array([path[-1] for path in paths])
        way = np.linalg.norm(here[:, None] - cell[None], axis=2)
        arrival = np.where(able, clock[:, None] + way / fleet.speed_max[:, None], np.inf)
        agent, goal = np.unravel_index(int(np.argmin(arrival)), arrival.shape)
        paths[agent].append(cell[goal])
        clock[agent] = arrival[agent, goal]
        near = np.linalg.norm(cell - cell[goal], axis=1)
        seen = near[None] <= _SEEN * fleet.radius[agent][:, None]
        seen[:, goal] = np.isfinite(fleet.radius[agent])
        left &= ~seen
    return Guess(Origin(GuessKind.TOUR, "tour"), [np.array(path[1:] or path) for path in paths])
