"""Work shared out along the shape, whatever it is: narrow, winding, oblique, in islands.

Lanes follow the shape, a short tour joins them, what it passes needlessly is cut off, and the path is divided among the
agents so that all end at the same time; where the range forbids that, all fly along it in file. Sweeps over bounding
boxes are no guesses where most of the box is empty.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.planning.initial_guess.boustrophedon import teams_of
from mpc_cover.planning.initial_guess.guess import Guess, GuessKind, Origin
from mpc_cover.planning.initial_guess.path_comparison import flight_time
from mpc_cover.planning.initial_guess.path_division import divided, in_file
from mpc_cover.planning.initial_guess.path_shortening import shortened
from mpc_cover.planning.initial_guess.segment_tour import segment_tour
from mpc_cover.planning.initial_guess.shape_lanes import shape_lanes

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.initial_guess.boustrophedon import Team
    from mpc_cover.planning.task import Task

_CELLS_MAX = 3000
"""Cells beyond which those in a square of part of a swath are taken as one; a plain choice that bounds the time."""
_CONTRACTION = 0.2
"""Side of that square, in half swaths; a plain choice."""
_OBLIQUE_MIN = 0.05
"""Angle between a principal direction and the axes [rad] from which lanes along it are tried; a plain choice."""


class ShapeTour:
    """Paths along the shape of the demand."""

    def guesses(self, task: Task, incumbent: Trajectory | None = None) -> Iterator[Guess]:  # noqa: ARG002 - from scratch
        """Yield guesses with lanes along the axes and along the principal directions, the shortest first."""
        teams = teams_of(task.fleet, task.cell, task.weight, task.period, slow=False)
        grouped = [_contracted(team.left, team.swath.half_width) for team in teams]
        by_team = [_by_direction(team, *some, task.position) for team, some in zip(teams, grouped, strict=True)]
        found = []
        for name in dict.fromkeys(name for paths in by_team for name in paths):
            shared, together = [here[None] for here in task.position], [here[None] for here in task.position]
            for team, paths, (cell, _) in zip(teams, by_team, grouped, strict=True):
                path = paths.get(name, next(iter(paths.values())))
                here = task.position[team.agents]
                parts = divided(path, cell, here, team.speed, task.fleet.separation_min)[0]
                for agent, part, whole in zip(team.agents, parts, in_file(path, here), strict=True):
                    shared[agent], together[agent] = part, whole
            found.append(Guess(Origin(GuessKind.SHAPE, f"shape, lanes {name}"), shared))
            if np.isfinite(task.fleet.communication_range):
                found.append(Guess(Origin(GuessKind.SHAPE, f"shape in file, lanes {name}"), together))
        yield from sorted(found, key=partial(flight_time, task))


def _by_direction(team: Team, cell: FloatArray, near: float, position: FloatArray) -> dict[str, FloatArray]:
    """Return for each direction of lanes a path (W, d) [m] along the shape of a team's cells, within `near` [m]."""
    middle = position[team.agents].mean(axis=0)
    tours = {name: segment_tour(shape_lanes(cell, near, axes), middle) for name, axes in _directions(cell)}
    return {name: shortened(tour.reshape(-1, cell.shape[1]), cell, near) for name, tour in tours.items()}


def _contracted(cell: FloatArray, half_width: float) -> tuple[FloatArray, float]:
    """Return the (K, d) cells [m], or fewer that stand for them, and the distance [m] within which to pass those."""
    if len(cell) <= _CELLS_MAX:
        return cell, half_width
    side = _CONTRACTION * half_width
    _, square = np.unique(np.floor((cell - cell.min(axis=0)) / side).astype(int), axis=0, return_inverse=True)
    square = square.ravel()
    total = np.stack([np.bincount(square, cell[:, a]) for a in range(cell.shape[1])], axis=1)
    mean: FloatArray = total / np.bincount(square)[:, None]
    return mean, half_width - float(np.linalg.norm(cell - mean[square], axis=1).max())


def _directions(cell: FloatArray) -> list[tuple[str, FloatArray]]:
    """Return names and (d, d) orthonormal rows: lanes along the first."""
    eye = np.eye(cell.shape[1])
    found = [(f"along axis {axis}", np.roll(eye, -axis, axis=0)) for axis in range(len(eye))]
    if len(eye) == 2 and len(cell) > 1:  # noqa: PLR2004 - the plane
        first = np.linalg.eigh(np.cov(cell.T))[1][:, 1]
        length = np.array([first, [-first[1], first[0]]])
        if np.abs(first).min() > np.sin(_OBLIQUE_MIN):
            found += [("along the length", length), ("across the length", length[::-1])]
    return found
