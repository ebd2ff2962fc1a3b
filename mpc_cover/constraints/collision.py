"""Collision avoidance (4.18): one separating half-space per pair and interval, kept at both samples of the interval."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.pairs import PairDistances, elastic_pair_rows
from mpc_cover.model.tolerances import DIVISOR_MIN, NO_DIRECTION

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.constraints.rows import Layout, Rows

_NO_MIDDLE = 1e-6
"""Below this [m] the mean of a pair's differences gives no direction, as when agents swap places; a plain choice."""


def separating_normals(layout: Layout, pairs: PairDistances, near: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Return (rows,) intervals and pairs that come within `near` (pairs,) [m], and normals (rows, d) between them."""
    middle = pairs.difference[:-1] + pairs.difference[1:]
    length = np.linalg.norm(middle, axis=2)
    interval, pair = np.nonzero(pairs.least < near)
    straight = length[interval, pair] > _NO_MIDDLE
    ends = pairs.difference[interval + 1, pair]
    direction = np.where(straight[:, None], middle[interval, pair], ends)
    norm = np.linalg.norm(direction, axis=1, keepdims=True)
    normal = np.where(norm > NO_DIRECTION, direction / np.maximum(norm, DIVISOR_MIN), np.eye(layout.dimension)[0])
    return interval, pair, normal


def collision_rows(
    layout: Layout, pairs: PairDistances, required: FloatArray, between: FloatArray, reach: float, first: int = 1
) -> Rows:
    """Return nbar . (q_i - q_j) >= required + between at both samples of each interval in which it may be active.

    A path under a zero-order hold deviates from its chord by at most a_rel T_s^2 / 8 (`between`): with the same
    half-space at both samples, that margin separates the pair throughout the interval.

    Parameters
    ----------
    required : (pairs,) rho_B and a margin [m].
    between : (pairs,) a_rel T_s^2 / 8 [m].
    reach : how much a distance can change within the trust region [m]; pairs farther apart need no row.
    first : the first sample that is not given.
    """
    interval, pair, normal = separating_normals(layout, pairs, required + between + reach)
    sample = np.concatenate([interval, interval + 1])
    both_pair, both_normal = np.tile(pair, 2), np.tile(normal, (2, 1))
    free = sample >= first
    sample, both_pair, both_normal = sample[free], both_pair[free], both_normal[free]
    reached = np.einsum("rd,rd->r", both_normal, pairs.difference[sample, both_pair])
    wanted = required[both_pair] + between[both_pair]
    # an iterate within the margin, but no nearer than rho_B, may stay where it is
    bound = np.where(reached < required[both_pair], required[both_pair], np.minimum(wanted, reached))
    slack = np.arange(sample.size)
    return elastic_pair_rows(layout, sample, both_pair, -both_normal, -bound, slack)
