"""Dwell times along given paths, from a linear programme, so that every cell gets the looks that it demands.

A path is cut into short pieces. Its agent spends n_p >= 0 samples on piece p, which are looks at all cells in range
of it. The time until the last agent has finished is minimised:

    min max_i sum_p n_ip   s.t.   sum_ip n_ip [||p - c_k|| <= rho_ij] >= looks_jk,   n_ip >= length_ip / (v_i T_s).

One slow pass takes far less time than repeated passes: lanes overlap, and no agent turns in between.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from mpc_cover.model.sensing import TIE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.fleet import Fleet

_PIECE, _PIECE_MAX, _PIECES = 0.25, 0.5, 1000
"""Length of a piece in sensing radii, raised up to the second value to keep the number of pieces near the third, which
bounds the size of the programme. Plain choices."""
_SPEED_SHARE = 0.75
"""Part of the top speed at which pieces are passed at most; the rest is for acceleration. Plain choice."""
_RADIUS_MARGIN = 0.02
"""Part by which the sensing radius is reduced where looks are counted, since the tracked motion is smoother. Plain
choice."""
_IDLE_COST = 1e-3
"""Cost of the mean dwell time relative to the makespan, so that agents that finish early do not dwell needlessly. Plain
choice."""


@dataclass(frozen=True, eq=False)
class DwellTimes:
    """Paths cut into pieces, and the dwell time of each piece.

    Attributes
    ----------
    point : for each agent (P_i, d) [m], the middles of its pieces, in order.
    length : for each agent (P_i,) [m].
    samples : for each agent (P_i,), dwell times in samples, not necessarily whole.
    """

    point: list[FloatArray]
    length: list[FloatArray]
    samples: list[FloatArray]


def discretised(path: FloatArray, longest: float) -> tuple[FloatArray, FloatArray]:
    """Return points (P, d) [m] and lengths (P,) [m] of pieces of at most `longest` [m] of a path (W, d) [m].

    The points are the waypoints and evenly spaced ones between them; a piece reaches half-way to its neighbours.
    """
    parts = [path[:1]]
    for here, there in pairwise(path):
        count = max(1, int(np.ceil(np.linalg.norm(there - here) / longest)))
        parts.append(here + (there - here) * np.linspace(0.0, 1.0, count + 1)[1:, None])
    point = np.concatenate(parts)
    between = np.linalg.norm(np.diff(point, axis=0), axis=1)
    return point, 0.5 * (np.append(between, 0.0) + np.append(0.0, between))


def solve_dwell_times(
    paths: Sequence[FloatArray],
    fleet: Fleet,
    cell: FloatArray,
    looks: FloatArray,
    period: float,
) -> DwellTimes | None:
    """Return the dwell times along paths (W_i, d) [m]; None if the programme was not solved.

    `cell` is (K, d) [m]; `looks` (J, K) demanded, not necessarily whole; `period` T_s [s]. Cells in range of no path
    are left out.
    """
    radius = fleet.radius
    scale = float(radius[np.isfinite(radius)].min())
    total_length = sum(float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()) for path in paths)
    share = float(np.clip(total_length / (_PIECES * scale), _PIECE, _PIECE_MAX))
    cut = [discretised(path, share * scale) for path in paths]
    least = [length / (_SPEED_SHARE * fleet.speed_max[i] * period) for i, (_, length) in enumerate(cut)]
    seen, demanded = _visibility([point for point, _ in cut], fleet, cell, looks)
    count = [len(point) for point, _ in cut]
    total = sum(count)
    each: Any = scipy.sparse.block_diag([np.ones((1, size)) for size in count])
    within = scipy.sparse.hstack([each, scipy.sparse.csr_array(np.full((len(count), 1), -1.0))])
    looked = scipy.sparse.hstack([-seen, scipy.sparse.csr_array((demanded.size, 1))])
    rows: Any = scipy.sparse.vstack(
        [looked, within], format="csr"
    )  # HiGHS takes sparse rows, which its stubs do not know
    cost = np.append(np.full(total, _IDLE_COST / total), 1.0)
    found = scipy.optimize.linprog(
        cost,
        A_ub=rows,
        b_ub=np.concatenate([-demanded, np.zeros(len(count))]),
        bounds=[*((float(low), None) for low in np.concatenate(least)), (0.0, None)],
        method="highs",
    )
    if found.x is None:
        return None
    samples = np.split(found.x[:total], np.cumsum(count)[:-1])
    return DwellTimes([point for point, _ in cut], [length for _, length in cut], samples)


def _visibility(points: list[FloatArray], fleet: Fleet, cell: FloatArray, looks: FloatArray) -> tuple[Any, FloatArray]:
    """Return which pieces (columns) see which demanded (magnitude, cell) in range of any, and the demanded looks."""
    blocks, demanded = [], []
    for magnitude in range(looks.shape[0]):
        wanted = np.flatnonzero(looks[magnitude] > 0.0)
        near = [
            np.linalg.norm(cell[wanted, None] - point[None], axis=2)
            <= (1.0 - _RADIUS_MARGIN) * fleet.radius[i, magnitude] + TIE
            for i, point in enumerate(points)
        ]
        table = np.concatenate(near, axis=1)
        reached = table.any(axis=1)
        blocks.append(scipy.sparse.csr_array(table[reached].astype(float)))
        demanded.append(looks[magnitude, wanted[reached]].astype(float))
    return scipy.sparse.vstack(blocks).tocsr(), np.concatenate(demanded)


def timed_samples(dwell_times: DwellTimes, count: int) -> FloatArray:
    """Return the positions (count+1, m, d) [m] of all agents at samples 0 to `count`.

    A piece is passed at constant speed within its dwell time; at the end of its path an agent rests.
    """
    columns = []
    for point, length, samples in zip(dwell_times.point, dwell_times.length, dwell_times.samples, strict=True):
        arc = np.append(0.0, np.cumsum(length))  # arc length at the ends of the pieces
        when = np.append(0.0, np.cumsum(samples))
        at = np.interp(np.arange(count + 1.0), when, arc)
        middle = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(point, axis=0), axis=1)))
        columns.append(np.stack([np.interp(at, middle, point[:, a]) for a in range(point.shape[1])], axis=1))
    return np.stack(columns, axis=1)
