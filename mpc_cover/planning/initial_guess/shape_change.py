"""Shapes of a formation, and the way from one to another: every leg is a straight line of all agents at once.

Along such a leg, on which all agents are the same part of their way at any time, each difference of two positions moves
on a straight segment. Its largest length is at an end, and its least is known exactly: separation and range hold along
the continuous path, not at samples of it.

A fleet that is linked like a chain is unfolded: each link keeps a length within range, and turns towards the direction
across the sweep. What was a block becomes a line abreast, as wide as the links allow.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.pairs import all_pairs
from mpc_cover.model.tolerances import DIVISOR_MIN, NO_DIRECTION

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray

_TURNS = (1, 2, 4, 8, 16)
"""Numbers of legs in which links turn, the fewest first that keep all distances; plain choices. With the last, links
between legs are shorter by at most half a percent."""
_CHAIN_TRIALS = 4000
"""Agents that the search for a chain may append; a plain choice, two orders above what it takes in a block."""
_ROUNDING = 1e-9
"""Tolerance of comparisons of distances, relative to the range; a plain choice."""


@dataclass(frozen=True, eq=False)
class Distances:
    """Bounds on the distances within a formation.

    Attributes
    ----------
    least : (pairs,) least distance of each pair, over `constraints.pairs.all_pairs` [m].
    reach : longest link [m].
    """

    least: FloatArray
    reach: float

    def hold(self, shapes: list[FloatArray], links: IntArray) -> bool:
        """Return whether legs from shape (m, d) [m] to shape keep all pairs apart, and all `links` (L, 2) in range."""
        one, two = all_pairs(len(shapes[0]))
        apart = [shape[one] - shape[two] for shape in shapes]
        linked = [np.linalg.norm(shape[links[:, 0]] - shape[links[:, 1]], axis=1) for shape in shapes]
        slack = _ROUNDING * self.reach
        return all((length <= self.reach + slack).all() for length in linked) and all(
            (segment_distance(first, last) >= self.least - slack).all() for first, last in pairwise(apart)
        )


def segment_distance(first: FloatArray, last: FloatArray) -> FloatArray:
    """Return the least distance (n,) [m] from the origin to each segment from `first` to `last`, both (n, d) [m]."""
    way = last - first
    square = np.maximum((way**2).sum(axis=1), DIVISOR_MIN**2)
    part = np.clip(-(first * way).sum(axis=1) / square, 0.0, 1.0)
    return np.asarray(np.linalg.norm(first + part[:, None] * way, axis=1))


def chain_of(shape: FloatArray, reach: float, axis: int) -> IntArray | None:
    """Return the agents of a shape (m, d) [m] in an order in which neighbours are within `reach` [m]; None for none.

    The search goes on along `axis` as slowly as links allow, so that a block is passed column by column, to and fro:
    such a chain unfolds like an accordion. It is a bounded depth-first search, as the problem is hard in general.
    """
    count = len(shape)
    distance = np.linalg.norm(shape[:, None] - shape[None], axis=2)
    near = distance <= reach * (1.0 + _ROUNDING)
    order = np.argsort(shape[:, axis], kind="stable")
    nearest = np.argsort(shape[None, :, axis] + distance, axis=1, kind="stable")
    follow = [[int(j) for j in nearest[i] if near[i, j] and j != i] for i in range(count)]
    trials = _CHAIN_TRIALS
    for start in order[: max(count // 2, 1)]:
        path, choices = [int(start)], [iter(follow[int(start)])]
        while path:
            if len(path) == count:
                return np.array(path, dtype=np.intp)
            following = next((j for j in choices[-1] if j not in path), None)
            if following is None:
                path.pop()
                choices.pop()
                continue
            trials -= 1
            if trials < 0:
                return None
            path.append(following)
            choices.append(iter(follow[following]))
    return None


def unfolding(
    shape: FloatArray,
    chain: IntArray,
    axis: int,
    width: float,
    link: float,
    distances: Distances,
    room: float = np.inf,
) -> list[FloatArray] | None:
    """Return shapes (m, d) [m] from `shape`, exclusive, to a line along `axis`, `width` [m] wide or little more.

    The links of the `chain` become up to `link` [m] long, and turn towards the axis: all the way, or, where a straight
    line does not fit into `room` [m], as far as the width requires. None where no way keeps all `distances`.
    """
    links = np.stack([chain[:-1], chain[1:]], axis=1)
    vector = np.diff(shape[chain], axis=0)
    length = np.linalg.norm(vector, axis=1)
    shortest = min(float(distances.least.max()), link)
    straight = float(np.clip(width / len(vector), 0.5 * (shortest + link), link))
    if straight * len(vector) > room:
        straight = max(room / len(vector), shortest)
    fits = straight * len(vector) <= room * (1.0 + _ROUNDING)
    fan = _fan(vector / np.maximum(length, NO_DIRECTION)[:, None], axis)
    # links as short as the straight line needs them, or, where that is too near for turning, long ones that shrink last
    for turning in dict.fromkeys((straight, link)):
        part = 1.0 if fits else _least_part(fan, turning, axis, min(width, room))
        for pieces in _TURNS:
            parts = [*np.linspace(0.0, part, pieces + 1).tolist(), part]
            lengths = [turning] * (pieces + 1) + [straight if part == 1.0 else turning]
            away = [_placed(size * fan.at(one), chain) for one, size in zip(parts, lengths, strict=True)]
            shapes = away[:-1] if lengths[-1] == turning else away
            if distances.hold([shape - shape.mean(axis=0), *shapes], links):
                return [each + shape.mean(axis=0) for each in shapes]
    return None


def _placed(vector: FloatArray, chain: IntArray) -> FloatArray:
    """Return the shape (m, d) [m] around its mean of a chain with links (m-1, d) [m]."""
    placed = np.empty((len(chain), vector.shape[1]))
    placed[chain] = np.concatenate([np.zeros((1, vector.shape[1])), np.cumsum(vector, axis=0)])
    return np.asarray(placed - placed.mean(axis=0))


@dataclass(frozen=True, eq=False)
class _Fan:
    """Unit vectors that turn towards an axis: `own` (n, d), `aside` (n, d) orthogonal to the axis, `angle` (n,)."""

    axis: FloatArray
    aside: FloatArray
    angle: FloatArray

    def at(self, part: float) -> FloatArray:
        """Return the vectors (n, d) once `part` of the angle to the axis is turned."""
        left = ((1.0 - part) * self.angle)[:, None]
        return np.asarray(np.cos(left) * self.axis + np.sin(left) * self.aside)


def _fan(unit: FloatArray, axis: int) -> _Fan:
    """Return the turn of unit vectors (n, d) towards an axis."""
    towards = np.eye(unit.shape[1])[axis]
    aside = unit - unit[:, [axis]] * towards
    size = np.linalg.norm(aside, axis=1)
    any_aside = np.eye(unit.shape[1])[axis - 1]
    aside = np.where(size[:, None] > NO_DIRECTION, aside / np.maximum(size, NO_DIRECTION)[:, None], any_aside)
    return _Fan(towards, aside, np.arctan2(size, unit[:, axis]))


def _least_part(fan: _Fan, link: float, axis: int, width: float) -> float:
    """Return the least part of the turn after which the chain is `width` [m] wide, 1 where it never is."""

    def wide(part: float) -> float:
        along = np.concatenate([[0.0], np.cumsum(link * fan.at(part)[:, axis])])
        return float(np.ptp(along))

    parts = np.linspace(0.0, 1.0, 101)
    enough = [part for part in parts if wide(float(part)) >= width * (1.0 - _ROUNDING)]
    return float(enough[0]) if enough else 1.0


def stretching(shape: FloatArray, links: IntArray, axis: int, width: float, distances: Distances) -> FloatArray | None:
    """Return the shape (m, d) [m] stretched along `axis` to `width` [m], or as far as its `links` (L, 2) allow.

    Stretched distances only grow: every pair stays apart. None where there is nothing to gain.
    """
    centre = shape.mean(axis=0)
    square = (shape[links[:, 0]] - shape[links[:, 1]]) ** 2
    own = square[:, axis]
    spare = distances.reach**2 - square.sum(axis=1) + own
    moving = own > NO_DIRECTION**2
    most = float(np.sqrt(np.maximum(spare[moving] / own[moving], 1.0)).min(initial=np.inf))
    now = float(np.ptp(shape[:, axis]))
    factor = min(most, width / now) if now > NO_DIRECTION else 1.0
    if not 1.0 + _ROUNDING < factor < np.inf:
        return None
    scale = np.ones(shape.shape[1])
    scale[axis] = factor
    return np.asarray(centre + scale * (shape - centre))
