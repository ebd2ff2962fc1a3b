"""Boustrophedon sweeps: lanes one swath wide, divided into strips, as one cut path (snake), or flown abreast (comb)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import shapely

from mpc_cover.planning.initial_guess.guess import Guess, GuessKind, Origin
from mpc_cover.planning.initial_guess.lanes import (
    Swath,
    assign,
    assign_pieces,
    comb,
    cut_lanes,
    cut_snake,
    slow_swath,
    snake,
    strips,
    swath_of,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.initial_guess.lanes import Lane
    from mpc_cover.planning.task import Task


_SMALLER_SHARE = 0.9
"""Area of the smallest rectangle around an area, over that of the box around it, below which sweeps follow the axes of
the rectangle. A plain choice."""


class Boustrophedon:
    """Back-and-forth sweeps of the whole demand along each axis.

    Parameters
    ----------
    slow : for many looks in a single pass: lanes overlap and reach into corners.
    """

    def __init__(self, *, slow: bool = False) -> None:
        self._slow = slow

    def guesses(self, task: Task, incumbent: Trajectory | None = None) -> Iterator[Guess]:  # noqa: ARG002 - from scratch
        """Yield strips of equal work, cut snakes and combs."""
        instants = task.fleet.look_instants
        look_s = 0.0 if instants.continuous else task.period / instants.per_step
        turn = frame_of_area(task.cell[(task.weight > 0.0).any(axis=0)])
        arrays = (task.fleet, task.cell @ turn.T, task.weight, task.position @ turn.T, look_s)
        for guess in sweep_guesses(*arrays, slow=self._slow):
            paths = [np.clip(path @ turn, task.fleet.motion_min, task.fleet.motion_max) for path in guess.paths]
            yield replace(guess, paths=paths)


def sweep_guesses(
    fleet: Fleet, cell: FloatArray, demand: FloatArray, position: FloatArray, period: float, *, slow: bool = False
) -> Iterator[Guess]:
    """Yield sweeps of the whole demand along each axis: strips of equal work, cut snakes, and combs.

    `cell` (K, d) [m]; `demand` (J, K) > 0 where there is demand; `position` (m, d) [m]; `period` [s] of looks.
    `slow` sweeps are for many looks in a single pass.
    """
    teams = teams_of(fleet, cell, demand, period, slow=slow)
    for axis in range(cell.shape[1]):
        yield by_team(
            GuessKind.STRIPS,
            f"strips along axis {axis}",
            position,
            teams,
            partial(_strips, position=position, axis=axis),
        )
    for axis in range(cell.shape[1]):
        for mirrored, upward in product((False, True), (True, False)):
            name = f"along axis {axis}{' mirrored' * mirrored}{' downward' * (not upward)}"

            def snakes(team: Team, a: int = axis, m: bool = mirrored, u: bool = upward) -> list[FloatArray]:
                pieces = cut_snake(cut_lanes(team.left, team.swath, a), team.speed, mirrored=m, upward=u)
                return assign_pieces(pieces, position[team.agents], team.speed, one_way=slow)

            def combs(team: Team, a: int = axis, m: bool = mirrored, u: bool = upward) -> list[FloatArray]:
                return comb(_even_lanes(team, a), position[team.agents], mirrored=m, upward=u)

            yield by_team(GuessKind.SNAKE, f"snake {name}", position, teams, snakes)
            yield by_team(GuessKind.COMB, f"comb {name}", position, teams, combs)


def frame_of_area(cell: FloatArray) -> FloatArray:
    """Return the rotation (d, d) into the axes of the smallest rectangle around cells (K, d) [m].

    The identity where the rectangle is not much smaller than the box around them, or in space.
    """
    if cell.shape[1] != 2 or cell.shape[0] < 3:  # noqa: PLR2004 - a rectangle in the plane
        return np.eye(cell.shape[1])
    hull = shapely.multipoints(cell).convex_hull
    box = shapely.minimum_rotated_rectangle(hull)
    if box.geom_type != "Polygon" or box.area > _SMALLER_SHARE * hull.envelope.area:
        return np.eye(2)
    first, second = np.array(box.exterior.coords[:2])
    along = (second - first) / np.linalg.norm(second - first)
    if abs(along[0]) < abs(along[1]):
        along = np.array([along[1], -along[0]])
    along = along * np.sign(along[0])
    return np.array([along, [-along[1], along[0]]])


@dataclass(frozen=True, eq=False)
class Team:
    """Agents that measure the same magnitudes: indices, (K', d) cells [m] with demand, swath, (n,) speeds [m/s]."""

    agents: IntArray
    left: FloatArray
    swath: Swath
    speed: FloatArray


def by_team(
    kind: GuessKind, name: str, position: FloatArray, teams: list[Team], paths_of: Callable[[Team], list[FloatArray]]
) -> Guess:
    """Return the guess in which each team flies `paths_of(team)` and all other agents rest."""
    paths = [here[None] for here in position]
    for team in teams:
        for agent, path in zip(team.agents, paths_of(team), strict=True):
            paths[agent] = path
    return Guess(Origin(kind, name), paths)


def teams_of(fleet: Fleet, cell: FloatArray, demand: FloatArray, period: float, *, slow: bool) -> list[Team]:
    """Return the teams for which there is demand."""
    able = np.isfinite(fleet.radius)
    teams = []
    for pattern in np.unique(able, axis=0):
        agents = np.flatnonzero((able == pattern).all(axis=1))
        left = cell[(demand[pattern] > 0.0).any(axis=0)]
        if len(left) and pattern.any():
            radius = float(fleet.radius[agents][:, pattern].min())
            speed = fleet.speed_max[agents]
            swath = slow_swath(radius) if slow else swath_of(radius, float(speed.max()), period)
            teams.append(Team(agents, left, swath, speed))
    return teams


def _strips(team: Team, position: FloatArray, axis: int) -> list[FloatArray]:
    """Return paths that sweep strips of equal work of a team's cells, one strip for each agent."""
    across = (axis + 1) % position.shape[1]
    here = position[team.agents]
    parts = [part for part in strips(team.left, team.speed, across) if len(part)]
    match = assign(here, _padded(np.array([part.mean(axis=0) for part in parts]), len(here)))
    flown = []
    for agent, part in enumerate(match):
        lanes = cut_lanes(parts[part], team.swath, axis) if part < len(parts) else []
        flown.append(snake(lanes, here[agent]) if lanes else here[agent][None])
    return flown


def _even_lanes(team: Team, axis: int) -> list[Lane]:
    """Return lanes whose number is a multiple of the agents, so that the last block of a comb is full."""
    agents = len(team.agents)
    lanes = cut_lanes(team.left, team.swath, axis)
    blocks = -(-len(lanes) // agents)
    return lanes if len(lanes) % agents == 0 else cut_lanes(team.left, team.swath, axis, count=blocks * agents)


def _padded(points: FloatArray, count: int) -> FloatArray:
    """Return `count` points: those given, and their mean for the agents without one."""
    missing = count - len(points)
    return np.concatenate([points, np.repeat(points.mean(axis=0)[None], missing, axis=0)]) if missing else points
