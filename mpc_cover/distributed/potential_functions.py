"""The potentials of the distributed law and their gradients (5.9 to 5.12, 6.1, 6.5), with the errata of design.md.

In the plane the coverage potential has no local minimum but where a cell is being measured: off the cores,
-1/r^alpha has the Laplacian -alpha (alpha + 2 - d) / r^(alpha + 2), which is negative for d = 2 and alpha > 0, or
d = 3 and alpha > 1. So every stationary point can be left by a small random step (lemma 5.3.1), and, since the
coordination terms do not change when the fleet moves as one, so can those of the sum (lemma 6.2.1).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.mission.fleet import Fleet

_GAP = 1e-6
"""Closest to its bound at which a pair's gradient is evaluated [m]: it stays finite, and huge."""


@dataclass(frozen=True)
class CoverageShape:
    """How a cell attracts (5.9).

    Attributes
    ----------
    alpha : how fast the attraction falls with the distance, > 1.
    core_m : distance within which a cell does not attract, beta^(1/alpha) [m]; at most the sensing radius, so
        that an agent that near measures the cell.
    """

    alpha: float = 4.0
    core_m: float = 0.5

    def __post_init__(self) -> None:
        if not (1.0 < self.alpha < np.inf and 0.0 < self.core_m < np.inf):
            raise ValueError(f"coverage potential: alpha {self.alpha}, core {self.core_m} m: must be > 1 and > 0")


def coverage_potential(position: FloatArray, cell: FloatArray, weight: FloatArray, shape: CoverageShape) -> FloatArray:
    """Return f (n,) of agents at (n, d) positions [m] (5.9, 5.10).

    `cell` is (K, d) [m]; `weight` gamma, (K,) for all or (n, K) for each agent's own.
    """
    _, square, gamma = _owed(position, cell, weight)
    core = shape.core_m**-shape.alpha
    well = np.maximum(core - np.maximum(square, shape.core_m**2) ** (-0.5 * shape.alpha), 0.0)
    return np.asarray((gamma * well).sum(axis=1))


def coverage_gradient(position: FloatArray, cell: FloatArray, weight: FloatArray, shape: CoverageShape) -> FloatArray:
    """Return df/dq (n, d) [1/m]: the sum over cells outside the core (5.12).

    Each gives alpha gamma (q - p) / ||q - p||^(alpha + 2); arguments as those of `coverage_potential`.
    """
    offset, square, gamma = _owed(position, cell, weight)
    pull = np.where(square > shape.core_m**2, np.maximum(square, shape.core_m**2) ** (-0.5 * shape.alpha - 1.0), 0.0)
    return np.asarray(shape.alpha * np.einsum("nk,nkd->nd", gamma * pull, offset))


def _owed(position: FloatArray, cell: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (n, K', d) q - p, (n, K') its square and gamma of the cells that any agent's map says are owed."""
    gamma = np.atleast_2d(weight)
    owed = gamma.any(axis=0)
    offset = position[:, None] - cell[owed]
    return offset, (offset**2).sum(axis=2), gamma[:, owed]


@dataclass(frozen=True)
class Coordination:
    """Bounds on distances, and where their potentials begin (6.1, 6.5).

    Attributes
    ----------
    separation_m : rho_B; 0 for none.
    repel_within_m : R_B > rho_B.
    range_m : rho_C; inf for none.
    attract_beyond_m : R_C < rho_C.
    """

    separation_m: float = 0.0
    repel_within_m: float = 0.0
    range_m: float = np.inf
    attract_beyond_m: float = np.inf

    def __post_init__(self) -> None:
        right = 0.0 <= self.separation_m < self.range_m
        right &= self.separation_m == 0.0 or self.separation_m < self.repel_within_m < np.inf
        right &= np.isinf(self.range_m) or 0.0 <= self.attract_beyond_m < self.range_m
        right &= self.repel_within_m <= self.range_m  # 6.1.1: neighbours suffice
        if not right:
            raise ValueError(f"{self}: must have rho_B < R_B <= rho_C and R_C < rho_C")


def coordination_of(
    fleet: Fleet, repel_within: float | None = None, attract_beyond: float | None = None
) -> Coordination:
    """Return a fleet's rho_B and rho_C with R_B and R_C [m]; left out, in the proportions of 6.3: 2 and 8/11.

    Raises
    ------
    ValueError
        The bounds contradict each other.
    """
    near, far = fleet.separation_min, fleet.communication_range
    repel = min(2.0 * near, far) if repel_within is None else repel_within
    attract = 8.0 / 11.0 * far if attract_beyond is None else attract_beyond
    return Coordination(near, repel, far, attract)


def collision_potential(position: FloatArray, bounds: Coordination) -> FloatArray:
    """Return g_coll (m, m) of each pair of agents at (m, d) positions [m]: inf at rho_B and below (6.1)."""
    length = pair_directions(position)[1]
    excess = np.maximum(bounds.repel_within_m - length, 0.0)
    return _ratio(excess, np.maximum(length - bounds.separation_m, 0.0))


def collision_gradient(position: FloatArray, bounds: Coordination) -> FloatArray:
    """Return (m, d): the sum over j of d g_coll / d q_i; it points towards agents that are too near (6.2)."""
    if bounds.separation_m == 0.0:
        return np.zeros_like(position)
    direction, length = pair_directions(position)
    gap = np.maximum(length - bounds.separation_m, _GAP)
    near = length < bounds.repel_within_m
    slope = np.where(near, (bounds.separation_m - bounds.repel_within_m) / gap**2, 0.0)
    return np.asarray((slope[:, :, None] * direction).sum(axis=1))


def connectivity_potential(position: FloatArray, kept: BoolArray, bounds: Coordination) -> FloatArray:
    """Return g_conn (m, m) of the kept (m, m) edges of agents at (m, d) positions [m]: inf at rho_C and above (6.5)."""
    if np.isinf(bounds.range_m):
        return np.zeros_like(kept, dtype=float)
    length = pair_directions(position)[1]
    excess = np.where(kept, np.maximum(length - bounds.attract_beyond_m, 0.0), 0.0)
    return _ratio(excess, np.maximum(bounds.range_m - length, 0.0))


def connectivity_gradient(position: FloatArray, kept: BoolArray, bounds: Coordination) -> FloatArray:
    """Return (m, d): the sum over kept j of d g_conn / d q_i; it points away from agents that are too far (6.6)."""
    if np.isinf(bounds.range_m):
        return np.zeros_like(position)
    direction, length = pair_directions(position)
    far = kept & (length > bounds.attract_beyond_m)
    gap = np.maximum(bounds.range_m - np.where(far, length, 0.0), _GAP)
    slope = np.where(far, (bounds.range_m - bounds.attract_beyond_m) / gap**2, 0.0)
    return np.asarray((slope[:, :, None] * direction).sum(axis=1))


def pair_directions(position: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (m, m, d) unit vectors from j to i and (m, m) lengths [m]; inf and zero on the diagonal.

    The tie of two agents in one place is broken by their order: the first is to the right.
    """
    offset = position[:, None] - position[None]
    length = np.sqrt((offset**2).sum(axis=2))
    unit = offset / np.where(length > 0.0, length, 1.0)[:, :, None]
    agents = np.arange(len(position))
    unit[..., 0] = np.where(length > 0.0, unit[..., 0], np.sign(agents[None] - agents[:, None]))
    np.fill_diagonal(length, np.inf)
    return unit, length


def _ratio(excess: FloatArray, room: FloatArray) -> FloatArray:
    """Return excess / room, 0 without excess and inf without room."""
    infinite = np.where(excess > 0.0, np.inf, 0.0)
    return np.divide(excess, room, out=infinite, where=room > 0.0)
