"""Collision avoidance (4.18): one separating half-space an interval, kept at both of its ends."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.pairs import PairDistances, elastic_pair_rows

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.constraints.rows import Layout, Rows


def collision_rows(
    layout: Layout, pairs: PairDistances, required: FloatArray, between: FloatArray, reach: float, first: int = 1
) -> Rows:
    """Return nbar . (q_i - q_j) >= required + between at both ends of each interval in which it could bind.

    A path under a zero-order hold leaves its chord by at most a_rel T_s^2 / 8 (`between`): with one
    half-space at both ends, that margin separates the whole interval.

    Parameters
    ----------
    required : (pairs,) rho_B and a margin [m].
    between : (pairs,) a_rel T_s^2 / 8 [m].
    reach : how much a distance may change within the trust region [m]; farther pairs need no row.
    first : the first sample that is not given.
    """
    middle = pairs.difference[:-1] + pairs.difference[1:]
    length = np.linalg.norm(middle, axis=2)
    interval, pair = np.nonzero(pairs.least < required + between + reach)
    straight = length[interval, pair] > 1e-6  # noqa: PLR2004 - a swap of places has no middle direction
    ends = pairs.difference[interval + 1, pair]
    direction = np.where(straight[:, None], middle[interval, pair], ends)
    norm = np.linalg.norm(direction, axis=1, keepdims=True)
    normal = np.where(norm > 1e-9, direction / np.maximum(norm, 1e-12), np.eye(layout.dimension)[0])  # noqa: PLR2004
    sample = np.concatenate([interval, interval + 1])
    both_pair, both_normal = np.tile(pair, 2), np.tile(normal, (2, 1))
    free = sample >= first
    sample, both_pair, both_normal = sample[free], both_pair[free], both_normal[free]
    reached = np.einsum("rd,rd->r", both_normal, pairs.difference[sample, both_pair])
    wanted = required[both_pair] + between[both_pair]
    # an iterate inside the margin, but not inside rho_B, may stay where it is
    bound = np.where(reached < required[both_pair], required[both_pair], np.minimum(wanted, reached))
    slack = np.arange(sample.size)
    return elastic_pair_rows(layout, sample, both_pair, -both_normal, -bound, slack)
