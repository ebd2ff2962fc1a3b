"""How long to stay where along given paths, so that every cell gets the looks that it is owed: a linear programme.

A path is cut into short pieces. Its agent spends n_p >= 0 samples on piece p, which are looks at whatever is in range
of it. Asked for is the shortest time in which all have done, by

    min max_i sum_p n_ip   s.t.   sum_ip n_ip [||p - c_k|| <= rho_ij] >= looks_jk,   n_ip >= length_ip / (v_i T_s).

What all looks at once take is far less than passing again and again: lanes overlap, and nobody turns in between.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp
from scipy.optimize import linprog

from mpc_cover.model.sensing import TIE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.fleet import Fleet

_PIECE, _LONGEST, _PIECES = 0.25, 0.5, 1000
"""Length of a piece in sensing radii: the first, but no more than so many pieces, but none longer than the second."""
_PACE = 0.75
"""Part of the top speed that pieces are passed at, at the most: the rest is for speeding up and slowing down."""
_INSIDE = 0.02
"""Looks are counted on so far inside the radius, as a part of it: motions are smoother than what is planned here."""
_IDLE = 1e-3
"""Cost of the samples of whoever ends before the last, as a part of the last's: nobody loiters for nothing."""


@dataclass(frozen=True, eq=False)
class DwellTimes:
    """Paths and how long each piece of them takes.

    Attributes
    ----------
    point : for each agent (P_i, d) [m], the middles of its pieces, from where it is now on.
    length : for each agent (P_i,) [m].
    samples : for each agent (P_i,), how many samples it spends there, not necessarily whole.
    """

    point: list[FloatArray]
    length: list[FloatArray]
    samples: list[FloatArray]


def discretised(path: FloatArray, longest: float) -> tuple[FloatArray, FloatArray]:
    """Cut a path with (W, d) waypoints [m] into pieces of at most `longest` [m]: points (P, d) and lengths (P,) [m].

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
    """Return how long to stay where along paths (W_i, d) [m]; None if the programme was not solved.

    `cell` is (K, d) [m]; `looks` (J, K) what is owed, not necessarily whole; `period` T_s [s]. What is in range of no
    path is left out.
    """
    radius = fleet.radius
    scale = float(radius[np.isfinite(radius)].min())
    way = sum(float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()) for path in paths)
    share = float(np.clip(way / (_PIECES * scale), _PIECE, _LONGEST))
    cut = [discretised(path, share * scale) for path in paths]
    least = [length / (_PACE * fleet.speed_max[i] * period) for i, (_, length) in enumerate(cut)]
    seen, asked = _seen([point for point, _ in cut], fleet, cell, looks)
    count = [len(point) for point, _ in cut]
    total = sum(count)
    each: Any = sp.block_diag([np.ones((1, size)) for size in count])
    within = sp.hstack([each, sp.csr_array(np.full((len(count), 1), -1.0))])
    enough = sp.hstack([-seen, sp.csr_array((asked.size, 1))])
    rows: Any = sp.vstack([enough, within], format="csr")  # HiGHS takes sparse rows, which its stubs do not know
    cost = np.append(np.full(total, _IDLE / total), 1.0)
    found = linprog(
        cost,
        A_ub=rows,
        b_ub=np.concatenate([-asked, np.zeros(len(count))]),
        bounds=[*((float(low), None) for low in np.concatenate(least)), (0.0, None)],
        method="highs",
    )
    if found.x is None:
        return None
    samples = np.split(found.x[:total], np.cumsum(count)[:-1])
    return DwellTimes([point for point, _ in cut], [length for _, length in cut], samples)


def _seen(points: list[FloatArray], fleet: Fleet, cell: FloatArray, looks: FloatArray) -> tuple[Any, FloatArray]:
    """Return which pieces (columns) look at which (magnitude, cell) that is owed and in range of any, and the looks."""
    blocks, asked = [], []
    for magnitude in range(looks.shape[0]):
        owed = np.flatnonzero(looks[magnitude] > 0.0)
        near = [
            np.linalg.norm(cell[owed, None] - point[None], axis=2) <= (1.0 - _INSIDE) * fleet.radius[i, magnitude] + TIE
            for i, point in enumerate(points)
        ]
        table = np.concatenate(near, axis=1)
        reached = table.any(axis=1)
        blocks.append(sp.csr_array(table[reached].astype(float)))
        asked.append(looks[magnitude, owed[reached]].astype(float))
    return sp.vstack(blocks).tocsr(), np.concatenate(asked)


def timed_samples(dwelling: DwellTimes, count: int) -> FloatArray:
    """Return where each agent is to be at samples 0 to `count`, (count+1, m, d) [m]; at its path's end from there on.

    A piece is passed at an even speed in its time.
    """
    columns = []
    for point, length, samples in zip(dwelling.point, dwelling.length, dwelling.samples, strict=True):
        way = np.append(0.0, np.cumsum(length))  # along the path, at the ends of the pieces
        when = np.append(0.0, np.cumsum(samples))
        at = np.interp(np.arange(count + 1.0), when, way)
        middle = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(point, axis=0), axis=1)))
        columns.append(np.stack([np.interp(at, middle, point[:, a]) for a in range(point.shape[1])], axis=1))
    return np.stack(columns, axis=1)
