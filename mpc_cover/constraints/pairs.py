"""Pairs of agents and their distances along a motion, as separation and connectivity constraints need them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.arrays import read_only
from mpc_cover.constraints.rows import elastic_rows

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.constraints.rows import Layout, Rows

WITHIN = (0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875)
"""Instants within an interval at which distances are sampled, as parts of it; a plain choice of seven."""


@lru_cache(maxsize=32)
def all_pairs(agents: int) -> tuple[IntArray, IntArray]:
    """Return the pairs i < j as two (pairs,) arrays."""
    first, second = np.triu_indices(agents, 1)
    return read_only(first), read_only(second)


@lru_cache(maxsize=32)
def linked_pairs(agents: int, links: tuple[tuple[int, int], ...]) -> IntArray:
    """Return the indices in `all_pairs` of links (i, j) given in any order."""
    number = {pair: index for index, pair in enumerate(zip(*(p.tolist() for p in all_pairs(agents)), strict=True))}
    return read_only(np.array(sorted({number[min(link), max(link)] for link in links}), dtype=np.intp))


@dataclass(frozen=True, eq=False)
class PairDistances:
    """Distances of all pairs along the continuous motion, sampled at `WITHIN` between samples.

    Attributes
    ----------
    difference : (N+1, pairs, d) q_i - q_j at the samples [m].
    sampled : (N+1, pairs) ||q_i - q_j|| [m].
    least, most : (N, pairs) smallest and largest distance within each interval, both samples included [m].
    """

    difference: FloatArray
    sampled: FloatArray
    least: FloatArray
    most: FloatArray


def pair_distances(position: FloatArray, velocity: FloatArray, period: float) -> PairDistances:
    """Return the distances of all pairs of a motion (N+1, m, d) [m], [m/s] under a zero-order hold of `period` [s]."""
    first, second = all_pairs(position.shape[1])
    difference = position[:, first] - position[:, second]
    sampled = _length(difference)
    least = np.minimum(sampled[:-1], sampled[1:])
    most = np.maximum(sampled[:-1], sampled[1:])
    relative = velocity[:, first] - velocity[:, second]
    bend = 0.5 * period * np.diff(relative, axis=0)  # T^2/2 (u_i - u_j)
    for part in WITHIN:
        inside = _length(difference[:-1] + (part * period) * relative[:-1] + part**2 * bend)
        np.minimum(least, inside, out=least)
        np.maximum(most, inside, out=most)
    return PairDistances(difference, sampled, least, most)


def distances_at(position: FloatArray) -> FloatArray:
    """Return the distances (pairs,) [m] between agents at (m, d) positions [m]."""
    first, second = all_pairs(len(position))
    return _length(position[first] - position[second])


def elastic_pair_rows(
    layout: Layout,
    sample: IntArray,
    pair: IntArray,
    normal: FloatArray,
    upper: FloatArray,
    slack: IntArray,
) -> Rows:
    """Return rows normal . (q_i - q_j)(sample) - s <= upper.

    `sample` (rows,); `pair` (rows,) indices into `all_pairs`; `normal` (rows, d);
    `upper` (rows,) [m]; `slack` (rows,) index of the slack of each row.
    """
    first, second = all_pairs(layout.agents)
    axes = np.arange(layout.dimension)
    column = np.concatenate(
        [
            layout.position(sample, first[pair])[:, None] + axes,
            layout.position(sample, second[pair])[:, None] + axes,
        ],
        axis=1,
    )
    value = np.concatenate([normal, -normal], axis=1)
    return elastic_rows(column, value, upper, slack)


def _length(vector: FloatArray) -> FloatArray:
    square = vector[..., 0] ** 2
    for axis in range(1, vector.shape[-1]):
        square = square + vector[..., axis] ** 2
    return np.asarray(np.sqrt(square))
