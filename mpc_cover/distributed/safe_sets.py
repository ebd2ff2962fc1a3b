"""Convex sets that two agents agree on without a message: as long as both stay in theirs, the pair's bounds hold.

Each agent occupies a ball: its stopping ball, or for a single integrator a ball of radius zero. From the two balls of
a pair both agents compute the same sets:

- separation: the half-spaces on either side of the gap's middle, moved apart by rho_B. A point of the one is
  at least rho_B from any point of the other.
- a kept edge: the ball of diameter rho_C about the middle of the smallest ball around both. Two of its points
  are at most rho_C apart.

An agent's safe set is the intersection of its pairs' sets and its box. It is convex, and contains the agent's own
ball when the pair's bound holds now; each pair's slack is split in half, so no agent waits for another. The sets
depend on the agent's neighbours only. A bound that is violated already is relaxed to its current value: it never
gets worse.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.distributed.potential_functions import pair_directions

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray

_SAFE = 1e-9
"""Taken off every bound, so that rounding cannot cross it [m]."""


@dataclass(frozen=True, eq=False)
class SafeSets:
    """Each agent's safe set: normal . x >= offset, ||x - centre|| <= reach, box.

    Attributes
    ----------
    normal : (m, m, d) unit vectors, from j towards i.
    offset : (m, m) [m]; -inf where the pair asks nothing.
    centre : (m, m, d) [m].
    reach : (m, m) [m]; inf where no edge is kept.
    lower, upper : (d,) [m] box.
    """

    normal: FloatArray
    offset: FloatArray
    centre: FloatArray
    reach: FloatArray
    lower: FloatArray
    upper: FloatArray

    def holds(self, point: FloatArray, radius: FloatArray) -> BoolArray:
        """Return (m, n): whether balls about (m, n, d) points with (m, n) radii [m] lie within agent m's pair sets."""
        along = np.einsum("mnd,mjd->mnj", point, self.normal) - radius[:, :, None]
        away = np.linalg.norm(point[:, :, None] - self.centre[:, None], axis=3) + radius[:, :, None]
        return np.asarray((along >= self.offset[:, None]).all(axis=2) & (away <= self.reach[:, None]).all(axis=2))

    def in_box(self, point: FloatArray) -> BoolArray:
        """Return (...,): whether (..., d) points [m] lie in the box."""
        return np.asarray(((point >= self.lower) & (point <= self.upper)).all(axis=-1))


def enclosing_diameters(centre: FloatArray, radius: FloatArray) -> FloatArray:
    """Return (m, m) [m]: the diameter of the smallest ball around each two of (m, d) centres with (m,) radii.

    With zero radii it is the distance. It is the weight by which edges exist and are chosen (`local_tree`): two agents
    with at most rho_C are within range of each other, and remain so while they brake.
    """
    length = pair_directions(centre)[1]
    apart = length + radius[:, None] + radius[None]
    larger = 2.0 * np.maximum(radius[:, None], radius[None])
    return np.asarray(np.where(apart > larger, apart, larger))


def safe_sets(
    centre: FloatArray,
    radius: FloatArray,
    heard: BoolArray,
    kept: BoolArray,
    *,
    separation: float,
    reach: float,
    box: tuple[FloatArray, FloatArray],
) -> SafeSets:
    """Return the safe sets of agents that occupy balls about (m, d) centres with (m,) radii [m].

    Row i uses the balls of agents that i hears, and its own.

    Parameters
    ----------
    heard : (m, m) which agents j agent i (row) hears: all that could come near it within a step.
    kept : (m, m) edges that agent i (row) keeps; not necessarily symmetric.
    separation : rho_B [m]; 0 asks for none.
    reach : rho_C [m].
    box : lower and upper corner (d,) [m].
    """
    direction, length = pair_directions(centre)
    length = np.where(heard, length, 0.0)
    own = np.einsum("md,mjd->mj", centre, direction) - radius[:, None]
    gap = length - radius[:, None] - radius[None]
    wanted = np.minimum(separation + _SAFE, np.maximum(gap, 0.0))
    # from the ball's edge back by half of the slack; overlapping balls may not come closer
    offset = own - 0.5 * np.maximum(gap - wanted, 0.0)
    around = enclosing_diameters(centre, radius)
    shift = 0.5 * np.clip(length + radius[None] - radius[:, None], 0.0, 2.0 * length)
    middle = centre[:, None] - direction * shift[:, :, None]
    now = np.linalg.norm(centre[:, None] - middle, axis=2) + radius[:, None]
    allowed = np.maximum(0.5 * np.maximum(reach - _SAFE, around), now)
    return SafeSets(
        direction,
        np.where(heard & (separation > 0.0), offset, -np.inf),
        middle,
        np.where(heard & kept, allowed, np.inf),
        *box,
    )
