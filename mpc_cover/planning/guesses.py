"""Guesses of different kinds for a motion that covers what is owed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.planning.lanes import assign, comb, cut_lanes, snake, strips

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.planning.lanes import Lane


@dataclass(frozen=True, eq=False)
class Guess:
    """Waypoints for each agent: `paths[i]` is (W_i, d) [m]."""

    kind: str
    paths: list[FloatArray]


def sweep_guesses(fleet: Fleet, cell: FloatArray, owed: FloatArray, position: FloatArray) -> Iterator[Guess]:
    """Yield sweeps of everything owed along each axis: strips of equal work, and combs.

    `cell` (K, d) [m]; `owed` (J, K) > 0 where something is left; `position` (m, d) [m].
    """
    for axis in range(cell.shape[1]):
        across = (axis + 1) % cell.shape[1]
        paths = [position[i][None] for i in range(fleet.size)]
        for team, left in _teams(fleet, cell, owed):
            share = fleet.speed_max[team] * _lane_radius(fleet, team)
            parts = [part for part in strips(left, share, across) if len(part)]
            middles = np.array([part.mean(axis=0) for part in parts])
            match = assign(position[team], _padded(middles, len(team)))
            for agent, part in zip(team, match, strict=True):
                if part < len(parts):
                    lanes = cut_lanes(parts[part], float(_lane_radius(fleet, team[:1])[0]), axis)
                    paths[agent] = snake(lanes, position[agent])
        yield Guess(f"strips along axis {axis}", paths)
    for axis in range(cell.shape[1]):
        for mirrored in (False, True):
            for upward in (True, False):
                paths = [position[i][None] for i in range(fleet.size)]
                for team, left in _teams(fleet, cell, owed):
                    radius = float(_lane_radius(fleet, team).min())
                    lanes = _even_lanes(left, radius, axis, len(team))
                    found = comb(lanes, position[team], mirrored=mirrored, upward=upward)
                    for agent, path in zip(team, found, strict=True):
                        paths[agent] = path
                yield Guess(f"comb along axis {axis}{' mirrored' * mirrored}{' downward' * (not upward)}", paths)


def tour_guess(fleet: Fleet, cell: FloatArray, owed: FloatArray, position: FloatArray) -> Guess:
    """Return a greedy tour: again and again the agent that can be first at a cell takes it.

    Made for what is left over: few, scattered cells. Arguments as in `sweep_guesses`.
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
        seen = near[None] <= 0.7 * fleet.radius[agent][:, None]
        seen[:, goal] = np.isfinite(fleet.radius[agent])
        left &= ~seen
    return Guess("tour", [np.array(path[1:] or path) for path in paths])


def rest_guess(position: FloatArray) -> Guess:
    """Return the guess that stays: always feasible."""
    return Guess("rest", [position[i][None] for i in range(position.shape[0])])


def _teams(fleet: Fleet, cell: FloatArray, owed: FloatArray) -> list[tuple[IntArray, FloatArray]]:
    """Return teams of agents with equal abilities, each with the cells on which it owes something."""
    able = np.isfinite(fleet.radius)
    patterns = np.unique(able, axis=0)
    teams = []
    for pattern in patterns:
        team = np.flatnonzero((able == pattern).all(axis=1))
        left = cell[(owed[pattern] > 0.0).any(axis=0)]
        if len(left) and pattern.any():
            teams.append((team, left))
    return teams


def _lane_radius(fleet: Fleet, team: IntArray) -> FloatArray:
    """Return for each agent of a team the smallest radius that it must sweep with [m]."""
    radius = fleet.radius[team]
    return np.asarray(np.where(np.isfinite(radius), radius, np.inf).min(axis=1))


def _even_lanes(cell: FloatArray, radius: float, axis: int, agents: int) -> list[Lane]:
    """Return lanes whose number is a multiple of the agents, where that costs no more blocks."""
    lanes = cut_lanes(cell, radius, axis)
    blocks = -(-len(lanes) // agents)
    return lanes if len(lanes) % agents == 0 else cut_lanes(cell, radius, axis, count=blocks * agents)


def _padded(points: FloatArray, count: int) -> FloatArray:
    """Repeat the mean for agents that are left over."""
    missing = count - len(points)
    return np.concatenate([points, np.repeat(points.mean(axis=0)[None], missing, axis=0)]) if missing else points
