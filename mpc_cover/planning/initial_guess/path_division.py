"""Division of one coverage path among agents, so that all end at the same time, the way to their parts included."""

from __future__ import annotations

from itertools import permutations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mpc_cover.planning.initial_guess.lanes import assign_times
from mpc_cover.planning.initial_guess.path_geometry import leg_distance, lengths_along, points_along

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import FloatArray

_ALL_ORDERS = 4
"""Agents up to which all orders along the path are compared, at most 24; a plain choice."""
_BISECTIONS = 24
"""Halvings of the interval of times; a plain choice, far below a period of any mission."""
_GAP_SHARE = 0.6
"""Part of the separation that the ends of adjacent parts stay away from the cut; a plain choice above a half."""


class Part(NamedTuple):
    """The part of a path between two lengths along it [m], and whether it is flown backward."""

    low: float
    high: float
    backward: bool


def path_position(path: FloatArray, cell: FloatArray) -> FloatArray:
    """Return for each of the (K, d) cells [m] the length along the (W, d) path [m] at which it is passed nearest."""
    at = lengths_along(path)
    nearest, position = np.full(len(cell), np.inf), np.zeros(len(cell))
    for k in range(len(path) - 1):
        distance, part = leg_distance(cell, path[k], path[k + 1])
        better = distance < nearest
        nearest = np.where(better, distance, nearest)
        position = np.where(better, at[k] + part * (at[k + 1] - at[k]), position)
    return position


def divided(
    path: FloatArray, cell: FloatArray, start: FloatArray, speed: FloatArray, gap: float = 0.0
) -> tuple[list[FloatArray], float]:
    """Return each agent's part of the (W, d) `path` [m], waypoints (W_i, d) [m], and the time [s] that all take.

    Every one of the (K, d) cells [m] belongs to the agent whose part passes it; stretches that pass no cell belong to
    nobody. `start` is (m, d) [m], `speed` (m,) [m/s]; ends of adjacent parts are `gap` [m] apart where both agents
    arrive there last.
    """
    position = np.unique(path_position(path, cell))
    place = points_along(path, position)
    away = np.linalg.norm(start[:, None] - place[None], axis=2)
    best_time: float = np.inf
    best: list[Part | None] = [None] * len(start)
    for order in _orders(position, away, speed):
        time, parts = _shared(position, away, speed, order)
        if time < best_time:
            best_time, best = time, parts
    return [_piece(path, here, part) for here, part in zip(start, _apart(best, gap), strict=True)], best_time


def in_file(path: FloatArray, start: FloatArray) -> list[FloatArray]:
    """Return each agent's waypoints (W_i, d) [m] along the whole (W, d) `path` [m], which all fly one behind the other.

    Whoever starts nearest to the path leads, and each other one, (m, d) [m], flies over the places where those before
    it start, so that they stay as far apart as they are. A fleet that must stay together is no faster in narrow shapes.
    """
    if np.linalg.norm(start - path[-1], axis=1).min() < np.linalg.norm(start - path[0], axis=1).min():
        path = path[::-1]
    length, order = lengths_along(path)[-1], _file_order(path[0], start)
    lag = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(start[order], axis=0), axis=1))])
    flown = list(start[:, None])
    for rank, agent in enumerate(order):
        before = start[order[:rank][::-1]]
        part = Part(0.0, float(max(length - lag[rank], 0.0)), backward=False)
        flown[agent] = np.concatenate([before, _piece(path, start[agent], part)])
    return flown


def _file_order(head: FloatArray, start: FloatArray) -> list[int]:
    """Return the order of agents in a file: the nearest to its `head` (d,) [m], then always the nearest to the last."""
    here, left, order = head, list(range(len(start))), []
    while left:
        agent = left[int(np.argmin(np.linalg.norm(start[left] - here, axis=1)))]
        left.remove(agent)
        order.append(agent)
        here = start[agent]
    return order


def _orders(position: FloatArray, away: FloatArray, speed: FloatArray) -> Sequence[tuple[int, ...]]:
    """Return the orders of agents along the path that are compared."""
    agents = len(speed)
    if agents <= _ALL_ORDERS:
        return list(permutations(range(agents)))
    middle = np.searchsorted(position, (np.arange(agents) + 0.5) / agents * position[-1])
    slot = assign_times(away[:, np.minimum(middle, len(position) - 1)] / speed[:, None])
    return [tuple(np.argsort(slot).tolist())]


def _shared(
    position: FloatArray, away: FloatArray, speed: FloatArray, order: tuple[int, ...]
) -> tuple[float, list[Part | None]]:
    """Return the least time in which the agents in this order pass all positions, and their parts; by bisection."""
    high = float(((away.max(axis=1) + position[-1] - position[0]) / speed).max())
    low, found = 0.0, _filled(position, away, speed, order, high)
    for _ in range(_BISECTIONS):
        time = 0.5 * (low + high)
        parts = _filled(position, away, speed, order, time)
        if parts is None:
            low = time
        else:
            high, found = time, parts
    assert found is not None
    return high, found


def _filled(
    position: FloatArray, away: FloatArray, speed: FloatArray, order: tuple[int, ...], time: float
) -> list[Part | None] | None:
    """Return parts, each as long as an agent can fly within `time` [s], approach included; None if cells are left."""
    first = 0
    parts: list[Part | None] = [None] * len(speed)
    for agent in order:
        if first == len(position):
            break
        approach = np.minimum(away[agent, first], away[agent, first:])
        able = np.flatnonzero(approach + position[first:] - position[first] <= time * speed[agent])
        if not able.size:
            continue
        last = first + int(able[-1])
        parts[agent] = Part(position[first], position[last], backward=bool(away[agent, last] < away[agent, first]))
        first = last + 1
    return parts if first == len(position) else None


def _apart(parts: list[Part | None], gap: float) -> list[Part | None]:
    """Return the parts, shortened where two agents would both end at the cut between them."""
    moved = list(parts)
    for i, one in enumerate(parts):
        for k, other in enumerate(parts):
            if one is None or other is None or one.backward or not other.backward:
                continue
            if 0.0 <= other.low - one.high < gap:
                moved[i] = one._replace(high=max(one.low, one.high - _GAP_SHARE * gap))
                moved[k] = other._replace(low=min(other.high, other.low + _GAP_SHARE * gap))
    return moved


def _piece(path: FloatArray, here: FloatArray, part: Part | None) -> FloatArray:
    """Return the waypoints (W, d) [m] of a part in the direction of flight; of none, where the agent is."""
    if part is None:
        return here[None]
    at = lengths_along(path)
    inside = path[(at > part.low) & (at < part.high)]
    ends = points_along(path, np.array([part.low, part.high]))
    piece = np.concatenate([ends[:1], inside, ends[1:]])
    return piece[::-1] if part.backward else piece
