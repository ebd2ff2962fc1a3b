"""Lower bounds on the time to cover an area of any shape, of which the swath bound is one.

The swath bound counts area, and is far too low where W is narrower than a swath or in several parts. Two others count
distance. Somebody has to reach the cell that is farthest from all starts. And points of W that are s apart must all
come within a sensing radius rho: together the agents' paths join the starts with the points' discs, so they are at
least as long as the minimum spanning forest, rooted at the starts, whose edges are the distances less 2 rho between
points, and less rho from a start. All take into account that agents start at rest: in time T an agent travels at most
v T - v^2 / (2 u).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.spatial.distance import cdist

from mpc_cover.model.motion import time_from_rest
from mpc_cover.verification.area_bound import swath_bound

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission

_SPACINGS = (3.0, 4.0, 6.0, 9.0, 13.0, 20.0)
"""Distances between the points in sensing radii, of which the best is taken; plain choices."""


def shape_bound(mission: Mission) -> float:
    """Return a time [s] about which no plan can be faster; 0.0 where nothing is known.

    Valid for one magnitude that all agents measure, and one look at each cell.
    """
    fleet = mission.fleet
    speed, starting = float(fleet.speed_max.sum()), float((0.5 * fleet.speed_max**2 / fleet.input_max).sum())
    distance = distance_bound(mission.field.cell, fleet.start, float(fleet.radius.max()))
    by_distance = (distance + starting) / speed if distance > 0.0 else 0.0
    by_area = swath_bound(mission)
    if by_area is not None:
        by_area = by_area / formation_share(mission) + starting / speed
    return max(by_distance, reach_bound(mission), by_area or 0.0)


def formation_share(mission: Mission) -> float:
    """Return the part of the swath of all agents together that the fleet's links leave to it, at most 1.

    m agents whose neighbours are within rho_C fly in line abreast at the widest, and sweep (m - 1) rho_C + 2 rho. Exact
    for a fleet that keeps its formation; one that changes it may be faster for as long as that takes.
    """
    fleet = mission.fleet
    radius = float(fleet.radius.max())
    widest = (fleet.size - 1) * min(fleet.communication_range, 2.0 * radius) + 2.0 * radius
    return widest / (2.0 * radius * fleet.size)


def reach_bound(mission: Mission) -> float:
    """Return when [s] the last cell can be measured at the earliest, each by the agent that can do so first."""
    fleet = mission.fleet
    way = np.maximum(cdist(mission.field.cell, fleet.start) - fleet.radius.max(axis=1), 0.0)
    return float(time_from_rest(way, fleet.speed_max, fleet.input_max).min(axis=1).max())


def distance_bound(cell: FloatArray, start: FloatArray, radius: float) -> float:
    """Return a length [m] that paths from `start` (m, d), all together, need to come within `radius` [m] of all cells.

    Parameters
    ----------
    cell : (K, d) [m].
    """
    return max(_forest(_spread(cell, start, spacing * radius), start, radius) for spacing in _SPACINGS)


def _spread(cell: FloatArray, start: FloatArray, spacing: float) -> FloatArray:
    """Return cells that are at least `spacing` apart, each the farthest from those before and from the starts."""
    distance = cdist(cell, start).min(axis=1)
    chosen = []
    while distance.max() >= spacing:
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, cdist(cell, cell[chosen[-1:]])[:, 0])
    return cell[chosen]


def _forest(point: FloatArray, start: FloatArray, radius: float) -> float:
    """Return the length of the minimum spanning forest of points' discs, rooted at the starts."""
    if not len(point):
        return 0.0
    edges = np.zeros((len(point) + 1, len(point) + 1))
    edges[1:, 1:] = cdist(point, point) - 2.0 * radius
    edges[0, 1:] = edges[1:, 0] = cdist(point, start).min(axis=1) - radius
    return float(minimum_spanning_tree(np.triu(np.maximum(edges, 0.0), 1)).sum())
