"""Cells that a motion leaves, inserted into its paths where the detour is least.

A cell left behind costs the way back to it. Measuring it in passing costs a detour of a few radii, by whoever can
afford it: cheapest insertion (Rosenkrantz, Stearns and Lewis, SIAM J. Computing 6, 1977).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.sensing import TIE
from mpc_cover.model.tolerances import DIVISOR_MIN
from mpc_cover.planning.initial_guess.path_geometry import path_length

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.mission.fleet import Fleet

REACH_SHARES = (0.5, 0.25, 0.0, 0.0, 0.0)
"""Distance from a cell at which a detour ends, in sensing radii, by attempt: agents turn before they reach a waypoint
and measure at samples only, so that what one attempt leaves is passed nearer by the next. Plain choices."""
_CELLS_MAX = 200
"""Cells up to which they are inserted: more of them are work for a search, not for detours. Plain choice."""


def with_cells(
    paths: list[FloatArray], cell: FloatArray, left: FloatArray, fleet: Fleet, share: float
) -> list[FloatArray] | None:
    """Return each agent's waypoints (W_i, d) [m], with detours to the (K, d) cells [m] where `left` (J, K) is positive.

    They come within `share` sensing radii. Each cell in turn is inserted where the longest flight grows least, then
    where the detour is shortest. None if there are too many cells, or one that nobody can measure.
    """
    todo = left > 0.0
    if np.count_nonzero(todo.any(axis=0)) > _CELLS_MAX:
        return None
    found = [np.asarray(path, dtype=float) for path in paths]
    time = np.array([path_length(path) for path in found]) / fleet.speed_max
    while todo.any():
        target = int(np.argmax(_nearest(found, cell, todo)))
        some = np.flatnonzero(np.isfinite(fleet.radius[:, todo[:, target]]).any(axis=1))
        if not some.size:
            return None
        options = [_insertion(found[i], cell[target], _reach(fleet, int(i), todo[:, target], share)) for i in some]
        later = np.array([time[i] + option[0] / fleet.speed_max[i] for i, option in zip(some, options, strict=True)])
        best = int(np.lexsort(([option[0] for option in options], np.maximum(later, time.max())))[0])
        agent, (_, place, point) = int(some[best]), options[best]
        found[agent] = np.insert(found[agent], place, point, axis=0)
        time[agent] = later[best]
        near, radius = np.linalg.norm(cell - point, axis=1), fleet.radius[agent]
        able = np.isfinite(radius)
        measured = able[:, None] & (near[None] <= share * np.where(able, radius, 0.0)[:, None] + TIE)
        measured[:, target] = able
        todo &= ~measured
    return found


def _reach(fleet: Fleet, agent: int, magnitudes: BoolArray, share: float) -> float:
    """Return a share of the distance [m] from which an agent measures those of the magnitudes (J,) that it can."""
    radius = fleet.radius[agent][magnitudes]
    return share * float(radius[np.isfinite(radius)].min())


def _nearest(paths: list[FloatArray], cell: FloatArray, todo: BoolArray) -> FloatArray:
    """Return (K,) distances [m] of the cells to the nearest waypoint; -1 where nothing is to do."""
    points = np.concatenate(paths)
    some = np.flatnonzero(todo.any(axis=0))
    distance = np.full(len(cell), -1.0)
    distance[some] = [np.linalg.norm(points - cell[k], axis=1).min() for k in some]
    return distance


def _insertion(path: FloatArray, cell: FloatArray, reach: float) -> tuple[float, int, FloatArray]:
    """Return the detour [m] of the cheapest insertion, the index of the new waypoint, and the waypoint (d,) [m]."""
    begin, end = path[:-1], path[1:]
    leg = end - begin
    part = np.clip(np.sum((cell - begin) * leg, axis=1) / np.maximum(np.sum(leg**2, axis=1), DIVISOR_MIN), 0.0, 1.0)
    foot = np.vstack([begin + part[:, None] * leg, path[-1:]])
    away = foot - cell
    size = np.linalg.norm(away, axis=1)
    point = cell + away * np.minimum(1.0, reach / np.maximum(size, DIVISOR_MIN))[:, None]
    detour = np.linalg.norm(point[:-1] - begin, axis=1) + np.linalg.norm(point[:-1] - end, axis=1)
    detour -= np.linalg.norm(leg, axis=1)
    costs = np.append(detour, np.linalg.norm(point[-1] - path[-1]))
    place = int(np.argmin(costs))
    return float(costs[place]), place + 1, point[place]
