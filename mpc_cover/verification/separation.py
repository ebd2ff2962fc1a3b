"""How close two agents come along the continuous path (4.18), not only at the samples.

On each interval a pair is r(s) = a + b s + c s^2 apart, s in [0, 1], so its squared distance is a quartic
whose minimum lies at an end or where the cubic r . r' crosses zero from below.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.verification.path import Path

_HALVINGS = 6
"""Bisections before Newton's method takes over."""
_MAX_NEWTON = 50
_SHARP = 1e-13
"""Precision of the instant, as a part of the interval."""


@dataclass(frozen=True)
class Distance:
    """A distance [m] between the agents of a pair (indices) at a time [s]."""

    value: float
    time: float
    pair: tuple[int, int]


def smallest_separation(path: Path) -> Distance | None:
    """Return the smallest distance of any two agents along the whole path; None for a single agent.

    Intervals that cannot hold the minimum, by a lower bound on their distance, are left out; the
    minimum is the true one all the same.
    """
    if path.position.shape[1] < 2:  # noqa: PLR2004 - a pair
        return None
    return min((_smallest(piece) for piece in path.pieces()), key=lambda distance: distance.value)


def smallest_separations(path: Path, pair: tuple[IntArray, IntArray] | None = None) -> FloatArray:
    """Return (P,) [m]: the smallest distance of each pair along the whole path, as `smallest_separation` finds it.

    `pair` are the (P,) first and (P,) second agents; all pairs, in the order of `Path.pair`, where it is left out.
    """
    each = [_smallest_of_each(piece, pair or piece.pair) for piece in path.pieces()]
    return np.asarray(np.min(each, axis=0))


def are_far_apart(path: Path, pair: tuple[IntArray, IntArray], least: FloatArray) -> bool:
    """Return whether bounds on intervals show that (P,) pairs keep `least` (P,) [m]; False where they do not tell."""
    return all(bool((_lower_bound(*piece.relative(pair)) >= least).all()) for piece in path.pieces())


def _smallest_of_each(path: Path, pair: tuple[IntArray, IntArray]) -> FloatArray:
    a, b, c = path.relative(pair)
    least = np.linalg.norm(np.concatenate([a, (a + b + c)[-1:]]), axis=-1).min(axis=0)
    rows, pairs = np.nonzero(_lower_bound(a, b, c) < least)
    if rows.size:
        _, distance = closest_approach(a[rows, pairs], b[rows, pairs], c[rows, pairs])
        np.minimum.at(least, pairs, distance)
    return np.asarray(least)


def _smallest(path: Path) -> Distance:
    first, second = path.pair
    a, b, c = path.relative()
    nodes = np.linalg.norm(np.concatenate([a, (a + b + c)[-1:]]), axis=-1)
    node, pair = np.unravel_index(int(np.argmin(nodes)), nodes.shape)
    best = Distance(float(nodes[node, pair]), float(path.time[node]), (int(first[pair]), int(second[pair])))
    rows, pairs = np.nonzero(_lower_bound(a, b, c) < best.value)
    if rows.size == 0:
        return best
    part, distance = closest_approach(a[rows, pairs], b[rows, pairs], c[rows, pairs])
    k = int(np.argmin(distance))
    if distance[k] >= best.value:
        return best
    row, pair = rows[k], pairs[k]
    time = float(path.time[row] + part[k] * (path.time[row + 1] - path.time[row]))
    return Distance(float(distance[k]), time, (int(first[pair]), int(second[pair])))


def closest_approach(a: FloatArray, b: FloatArray, c: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (s, distance), each (n,): the minimum over s in [0, 1] of |a + b s + c s^2| for (n, d) arrays.

    g = r . r' is a cubic with leading coefficient >= 0: it rises, may fall between two turning points,
    and rises again. Where it falls, the squared distance is concave, so the minimum lies in one of the
    two rising pieces, where g crosses zero, or at the end that is nearest to doing so.
    """
    cubic = (
        (a * b).sum(axis=-1),
        (b * b).sum(axis=-1) + 2.0 * (a * c).sum(axis=-1),
        3.0 * (b * c).sum(axis=-1),
        2.0 * (c * c).sum(axis=-1),
    )
    turn_down, turn_up = _turning_points(*cubic[1:])
    left = np.stack([np.zeros_like(turn_up), turn_up])
    right = np.stack([turn_down, np.ones_like(turn_down)])
    part = _rising_zero(cubic, left, right)
    distance = np.linalg.norm(a + part[..., None] * (b + part[..., None] * c), axis=-1)
    nearest = np.argmin(distance, axis=0)
    column = np.arange(nearest.size)
    return part[nearest, column], distance[nearest, column]


def _rising_zero(cubic: tuple[FloatArray, ...], left: FloatArray, right: FloatArray) -> FloatArray:
    """Return where g, rising from `left` to `right`, is zero; an end where it has one sign.

    Newton's method within a bracket that no step leaves, so that vanishing coefficients do no harm.
    """
    g0, g1, g2, g3 = cubic
    right = np.where(g0 + left * (g1 + left * (g2 + left * g3)) >= 0.0, left, right)
    left = np.where(g0 + right * (g1 + right * (g2 + right * g3)) <= 0.0, right, left)
    part = 0.5 * (left + right)
    for turn in range(_HALVINGS + _MAX_NEWTON):
        value = g0 + part * (g1 + part * (g2 + part * g3))
        left, right = np.where(value < 0.0, part, left), np.where(value < 0.0, right, part)
        middle = 0.5 * (left + right)
        if turn < _HALVINGS:
            part = middle
            continue
        slope = g1 + part * (2.0 * g2 + part * 3.0 * g3)
        newton = part - np.divide(value, slope, out=np.full_like(value, np.inf), where=slope > 0.0)
        inside = (newton >= left) & (newton <= right)
        after = np.where(inside, newton, middle)
        if (np.abs(after - part) <= _SHARP).all():
            return after
        part = after
    return part


def _turning_points(g1: FloatArray, g2: FloatArray, g3: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where g' = g1 + 2 g2 s + 3 g3 s^2 changes sign, clipped to [0, 1]; (1, 1) where g never falls."""
    discriminant = g2 * g2 - 3.0 * g1 * g3
    falls = discriminant > 0.0
    # the root without cancellation first, the other from their product
    q = -(g2 + np.copysign(np.sqrt(np.where(falls, discriminant, 0.0)), g2))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        one, other = q / (3.0 * g3), g1 / q
    down = np.where(falls, np.clip(np.minimum(one, other), 0.0, 1.0), 1.0)
    up = np.where(falls, np.clip(np.maximum(one, other), 0.0, 1.0), 1.0)
    return down, up


def _lower_bound(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return (T-1, P) [m]: the distance to the chord less the most that a parabola leaves it, |c| / 4."""
    chord = b + c
    square = (chord * chord).sum(axis=-1)
    along = -(a * chord).sum(axis=-1)
    part = np.clip(np.divide(along, square, out=np.zeros_like(square), where=square > 0.0), 0.0, 1.0)
    nearest = np.linalg.norm(a + part[..., None] * chord, axis=-1)
    return np.asarray(nearest - 0.25 * np.linalg.norm(c, axis=-1))
