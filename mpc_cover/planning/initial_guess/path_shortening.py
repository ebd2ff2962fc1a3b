"""Shortening of a coverage path: waypoints are left out or pulled straight as long as every cell stays near the path.

Lanes and the links between them make stairs along oblique parts of a shape, and turn farther out than they need to. A
waypoint is removed, or moved towards the line between its neighbours, wherever the cells that only its two legs pass
remain within the same distance of the new legs.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.tolerances import DIVISOR_MIN
from mpc_cover.planning.initial_guess.path_geometry import leg_distance, path_length

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray

_PULLS = (1.0, 0.6, 0.3, 0.1)
"""Parts of the way to the line between its neighbours that a waypoint is moved, the largest first; plain choices."""
_PASSES = 8
"""Passes over all waypoints at most; a plain choice."""
_GAIN_MIN = 2e-3
"""Relative gain in length below which passes end; a plain choice."""
_SIZE_MAX = 4_000_000
"""Legs times cells above which a path is left as it is; a plain choice that bounds time and memory."""
_ROUNDING = 1e-9
"""Relative tolerance of distances to the path; a plain choice."""


def shortened(path: FloatArray, cell: FloatArray, distance: float) -> FloatArray:
    """Return a path (W', d) [m] no longer than `path` that passes the same (K, d) cells [m] within `distance` [m]."""
    if len(path) < 3 or len(path) * len(cell) > _SIZE_MAX:  # noqa: PLR2004 - two ends and a waypoint between them
        return path
    near = distance * (1.0 + _ROUNDING)
    for _ in range(_PASSES):
        shorter = _one_pass(path, cell, near)
        gain = path_length(path) - path_length(shorter)
        path = shorter
        if gain <= _GAIN_MIN * path_length(path):
            break
    return path


def _one_pass(path: FloatArray, cell: FloatArray, near: float) -> FloatArray:
    """Remove or move each waypoint in turn, the two ends excepted.

    Of a leg that is moved, only cells that the two legs before passed count as passed: others may be passed as well,
    which the next pass sees.
    """
    passed = np.array([leg_distance(cell, a, b)[0] <= near for a, b in pairwise(path)])
    count = passed.sum(axis=0)
    points = path.copy()
    kept, row = [0], 0  # `row` of `passed` is the leg that ends at the waypoint in turn
    for k in range(1, len(path) - 1):
        before, here, after = points[kept[-1]], points[k], points[k + 1]
        local = np.flatnonzero(passed[row] | passed[k])
        own = passed[row, local].astype(int) + passed[k, local]
        only, some = count[local] == own, cell[local]
        reach = leg_distance(some, before, after)[0] <= near
        if reach[only].all():
            passed[k] = False
            passed[k, local] = reach
            count[local] += reach - own
            row = k
            continue
        chord = after - before
        part = np.clip((here - before) @ chord / max(float(chord @ chord), DIVISOR_MIN), 0.0, 1.0)
        for pull in _PULLS:
            place = here + pull * (before + part * chord - here)
            first, second = (leg_distance(some, a, b)[0] <= near for a, b in ((before, place), (place, after)))
            if (first | second)[only].all():
                passed[row, local], passed[k, local] = first, second
                count[local] += first.astype(int) + second - own
                points[k] = place
                break
        kept.append(k)
        row = k
    return points[[*kept, len(path) - 1]]
