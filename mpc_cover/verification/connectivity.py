"""Connectivity of the fleet at every instant (4.20), though its tree may change between samples.

The fleet is connected within rho_C at an instant exactly when the longest edge of its Euclidean minimum
spanning tree, the bottleneck, is at most rho_C. Over a segment of the path the bottleneck is at most that of
the graph weighted with each pair's largest distance; where this bound is too loose, the segment is halved.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mpc_cover.verification.separation import Distance

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.verification.path import Path

_MAX_DEPTH = 24
"""Halvings of an interval: 6e-8 of it, in case two edges change places exactly at the bottleneck."""
_MOST_EDGES = 1_000_000
"""Edges of graphs that are processed at once: some tens of megabytes."""
_MAX_OPEN = 4096
"""Segments processed at a time; beyond it the bound itself is reported, which is conservative."""


class _Widest(NamedTuple):
    """The largest bottleneck [m] so far, when [s], and the (P,) edge lengths [m] that gave it."""

    value: float
    time: float
    length: FloatArray


def widest_bottleneck(path: Path, *, limit: float = np.inf, resolution: float = 5e-7) -> Distance | None:
    """Return the largest bottleneck edge [m] along the whole path; None for a single agent.

    The value is never below the true one. It is above it by at most `resolution` [m], or, where that is more,
    by a hundredth of its distance to `limit` [m], and by more only when the bounds on the work are reached.
    """
    if path.position.shape[1] < 2:  # noqa: PLR2004 - a pair
        return None
    pieces = (_widest(piece, limit, resolution) for piece in path.pieces())
    return max(pieces, key=lambda distance: distance.value)


def _widest(path: Path, limit: float, resolution: float) -> Distance:
    first, second = path.pair
    agents = path.position.shape[1]
    a, b, c = path.relative()
    # Bezier points: the parabola lies in their hull, so no point of it is farther than the farthest of them
    segment, begin, end = np.stack([a, a + 0.5 * b, a + b + c]), path.time[:-1], path.time[1:]
    nodes = np.linalg.norm(np.concatenate([segment[0], segment[2, -1:]]), axis=-1)
    nothing = _Widest(-np.inf, 0.0, nodes[0])
    bound, reached = nothing, _larger(nothing, bottleneck(nodes, agents), path.time, nodes)
    for depth in range(_MAX_DEPTH + 1):
        farthest = np.linalg.norm(segment, axis=-1).max(axis=0)
        ceiling = bottleneck(farthest, agents)
        todo = ceiling > reached.value + resolution
        if np.isfinite(limit):
            todo &= ceiling - reached.value > 0.01 * np.abs(limit - ceiling)
        last = depth == _MAX_DEPTH or int(todo.sum()) > _MAX_OPEN
        settled = np.ones_like(todo) if last else ~todo
        bound = _larger(bound, ceiling[settled], 0.5 * (begin + end)[settled], farthest[settled])
        if last or not todo.any():
            break
        segment, begin, end = _halve(segment[:, todo], begin[todo], end[todo])
        half = begin.size // 2
        middle = np.linalg.norm(segment[2, :half], axis=-1)
        reached = _larger(reached, bottleneck(middle, agents), end[:half], middle)
    worst = reached if bound.value <= reached.value + resolution else bound
    edge = int(np.argmin(np.abs(worst.length - worst.value)))
    return Distance(max(reached.value, bound.value), worst.time, (int(first[edge]), int(second[edge])))


def bottlenecks(path: Path, parts: int = 4) -> tuple[FloatArray, FloatArray]:
    """Return when `parts` pieces of each interval begin (n,) [s], and a bound on the bottleneck in each (n,) [m].

    The bound is that of the piece's control points: never below the true bottleneck, and above it by at most
    a_rel h^2 / 8 on a piece of h [s].
    """
    a, b, c = path.relative()
    s, h = np.arange(parts)[:, None, None, None] / parts, 1.0 / parts
    begin, slope = a + s * (b + s * c), b + 2.0 * s * c
    points = np.stack([begin, begin + 0.5 * h * slope, begin + h * (slope + h * c)])
    farthest = np.linalg.norm(points, axis=-1).max(axis=0).swapaxes(0, 1).reshape(-1, a.shape[1])
    time = path.time[:-1, None] + np.diff(path.time)[:, None] * (np.arange(parts) / parts)
    return time.ravel(), bottleneck(farthest, path.position.shape[1])


def exchanged_bottlenecks(path: Path, other: Path) -> FloatArray:
    """Return (m,) bounds on the bottleneck [m] along the whole path when agent i alone flies the other path instead.

    Both are of the same times. The bound is that of the intervals' control points: never below the true bottleneck,
    and above it by at most a_rel h^2 / 8 on intervals of h [s]. Edges are computed once, for all the exchanges.
    """
    agents = path.position.shape[1]
    if agents < 2:  # noqa: PLR2004 - a pair
        return np.zeros(agents)
    (first, second), every = path.pair, np.arange(agents)
    old = _farthest(path, path.pair)  # (T-1, P)
    new = _farthest(path.beside(other), (np.repeat(agents + every, agents), np.tile(every, agents)))
    new = new.reshape(-1, agents, agents)  # (T-1, who is exchanged, the others)
    bound = np.zeros(agents)
    several = max(1, _MOST_EDGES // max(old.size, 1))
    for begin in range(0, agents, several):
        some = every[begin : begin + several]
        one, two = first == some[:, None], second == some[:, None]  # (several, P)
        length = np.where(one[:, None], new[:, some][:, :, second].swapaxes(0, 1), old)
        length = np.where(two[:, None], new[:, some][:, :, first].swapaxes(0, 1), length)
        bound[some] = bottleneck(length.reshape(-1, first.size), agents).reshape(some.size, -1).max(axis=1)
    return bound


def _farthest(path: Path, pair: tuple[IntArray, IntArray]) -> FloatArray:
    """Return (T-1, P) bounds on the distance [m] of pairs in each interval, by the control points."""
    a, b, c = path.relative(pair)
    return np.asarray(np.linalg.norm(np.stack([a, a + 0.5 * b, a + b + c]), axis=-1).max(axis=0))


def bottleneck(length: FloatArray, agents: int) -> FloatArray:
    """Return (n,): the longest edge of the minimum spanning tree of n graphs with (n, P) edge lengths [m].

    Prim's algorithm on all graphs at once; a pair's column is its place in `Path.pair`.
    """
    graphs = length.shape[0]
    # the diagonal points at a column of its own, so that no agent is near itself
    weight = np.concatenate([length, np.full((graphs, 1), np.inf)], axis=1)[:, _pair_index(agents)]
    row = np.arange(graphs)
    visited = np.zeros((graphs, agents), dtype=bool)
    visited[:, 0] = True
    near = weight[:, 0]
    widest = np.zeros(graphs)
    for _ in range(agents - 1):
        nearest = np.argmin(near, axis=1)
        widest = np.maximum(widest, near[row, nearest])
        visited[row, nearest] = True
        near = np.where(visited, np.inf, np.minimum(near, weight[row, nearest]))
    return widest


@lru_cache(maxsize=8)
def _pair_index(agents: int) -> IntArray:
    """Return (m, m): the column of each pair in (n, P) arrays; P on the diagonal."""
    first, second = np.triu_indices(agents, k=1)
    index = np.full((agents, agents), first.size)
    index[first, second] = index[second, first] = np.arange(first.size)
    return index


def _halve(segment: FloatArray, begin: FloatArray, end: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Split each parabola at its middle (de Casteljau)."""
    start, control, stop = segment
    left, right = 0.5 * (start + control), 0.5 * (control + stop)
    middle, time = 0.5 * (left + right), 0.5 * (begin + end)
    halves = np.concatenate([np.stack([start, left, middle]), np.stack([middle, right, stop])], axis=1)
    return halves, np.concatenate([begin, time]), np.concatenate([time, end])


def _larger(so_far: _Widest, widest: FloatArray, time: FloatArray, length: FloatArray) -> _Widest:
    """Return the larger of `so_far` and the (n,) bottlenecks at (n,) times of graphs with (n, P) edges."""
    if widest.size == 0:
        return so_far
    k = int(np.argmax(widest))
    return _Widest(float(widest[k]), float(time[k]), length[k]) if widest[k] > so_far.value else so_far
