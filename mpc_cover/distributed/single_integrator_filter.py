"""Collision avoidance and connectivity of sampled single integrators (5.1): guarantees that potentials cannot give.

At a finite T_s and with bounded inputs a step can jump over the barriers of (6.1) and (6.5). So each agent's step is
cut to its safe set (`safe_sets`), which is convex and holds its own position: the straight path between two
samples stays in it. All pairs then keep rho_B, and all edges that both ends keep stay within rho_C, at every
instant. These contain the fleet's minimum spanning tree (`local_tree`), so a connected fleet remains connected.
An agent uses positions of those it hears only, which must include all within rho_B and two steps of it.

Of the desired step and a fan of others, each as long as the set allows, the one that ends nearest to the desired
position is taken: agents slide along the boundaries of their sets instead of stopping at them.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.distributed.safe_sets import SafeSets

_SHORTER = 1.0 - 1e-12
"""Steps are this much shorter than the set allows, for the rounding of the sum."""
_PLANE = 2


def filter_steps(position: FloatArray, step: FloatArray, longest: FloatArray, sets: SafeSets) -> FloatArray:
    """Return the (m, d) steps [m] nearest to those desired that stay in the safe sets; zero always does.

    Parameters
    ----------
    position : (m, d) [m]; each in its set.
    step : (m, d) desired [m].
    longest : (m,) u_max T_s [m] (5.2).
    sets : of these positions.
    """
    length = np.linalg.norm(step, axis=1)
    ahead = step / np.where(length > 0.0, length, 1.0)[:, None]
    fixed = fan(position.shape[1])
    direction = np.concatenate([ahead[:, None], np.broadcast_to(fixed, (len(step), *fixed.shape))], axis=1)
    useful = np.clip(np.einsum("mnd,md->mn", direction, step), 0.0, longest[:, None])
    free = np.minimum(useful, _room(position, direction, sets) * _SHORTER)
    move = free[:, :, None] * direction
    miss = np.linalg.norm(move - step[:, None], axis=2)
    return np.asarray(move[np.arange(len(step)), np.argmin(miss, axis=1)])


def _room(position: FloatArray, direction: FloatArray, sets: SafeSets) -> FloatArray:
    """Return (m, n) [m]: how far agents may go from (m, d) positions along (m, n, d) unit vectors."""
    slack = np.maximum(np.einsum("md,mjd->mj", position, sets.normal) - sets.offset, 0.0)
    towards = -np.einsum("mnd,mjd->mnj", direction, sets.normal)
    plane = _quotient(slack[:, None], towards).min(axis=2, initial=np.inf)
    arm = position[:, None] - sets.centre
    inside = np.maximum(sets.reach**2 - (arm**2).sum(axis=2), 0.0)
    along = np.einsum("mnd,mjd->mnj", direction, arm)
    # far along the ray the sum of the two terms cancels; the quotient does not
    root = np.sqrt(along**2 + np.where(np.isfinite(inside), inside, 0.0)[:, None])
    hit = np.where(along > 0.0, _quotient(inside[:, None], along + root), root - along)
    ball = np.where(np.isfinite(sets.reach)[:, None], hit, np.inf).min(axis=2, initial=np.inf)
    up = _quotient(np.maximum(sets.upper - position, 0.0)[:, None], direction).min(axis=2)
    down = _quotient(np.maximum(position - sets.lower, 0.0)[:, None], -direction).min(axis=2)
    return np.asarray(np.minimum(np.minimum(plane, ball), np.minimum(up, down)))


def _quotient(room: FloatArray, speed: FloatArray) -> FloatArray:
    """Return room / speed where the speed is towards the boundary, else inf."""
    shape = np.broadcast_shapes(room.shape, speed.shape)
    return np.asarray(np.divide(room, speed, out=np.full(shape, np.inf), where=speed > 0.0))


@lru_cache(maxsize=4)
def fan(dimension: int) -> FloatArray:
    """Return (n, d) unit vectors in all directions: 32 in the plane, 96 in space (a Fibonacci sphere)."""
    if dimension == _PLANE:
        angle = 2.0 * np.pi * np.arange(32) / 32
        return np.stack([np.cos(angle), np.sin(angle)], axis=1)
    index = np.arange(96) + 0.5
    height = 1.0 - 2.0 * index / 96
    turn = np.pi * (1.0 + np.sqrt(5.0)) * index
    flat = np.sqrt(1.0 - height**2)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), height], axis=1)
