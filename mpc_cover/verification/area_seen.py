"""How much of W came within range: by points of W that know nothing of its cells."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

from mpc_cover.mission.field import bounding_box, cell_weights, contains
from mpc_cover.verification.loss_evidence import of_the_living
from mpc_cover.verification.losses import losses_of

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.mission.config import Area
    from mpc_cover.trajectory_file import Recording

POINTS = 20_000
"""Points of W that are looked at: the share of a strip of 1 % is known to about 0.05 %. A plain choice."""
_ROUNDS = 64
"""How many times as many points of the bounding box are tried, for areas that fill little of theirs."""
_TIE = 1e-9
"""A point at distance rho is seen, in spite of rounding, relative to rho."""


def area_seen(trajectory: Recording) -> float | None:
    """Return the part of W, 0 to 1, of which every magnitude was in range at a sample; None without a point in W.

    Every point that matters counts the same, and once, whatever the mission asks for: K looks see no more area. The
    lost see none.
    """
    trajectory, point = of_the_living(trajectory, losses_of(trajectory)), points_of(trajectory.mission.spec.area)
    if point.shape[0] == 0:
        return None
    seen: BoolArray = np.ones(point.shape[0], dtype=bool)
    for radius in trajectory.mission.fleet.radius.T:
        near = np.zeros_like(seen)
        for reach in np.unique(radius[radius > 0.0]):
            flown = trajectory.position[:, radius == reach].reshape(-1, point.shape[1])
            flown = flown[np.isfinite(flown).all(axis=1)]
            left = np.flatnonzero(seen & ~near)
            bound = float(reach) * (1.0 + _TIE)
            near[left] = np.isfinite(
                scipy.spatial.cKDTree(np.unique(flown, axis=0)).query(point[left], distance_upper_bound=bound)[0]
            )
        seen &= near
    return float(seen.mean())


def points_of(area: Area) -> FloatArray:
    """Return (n, d) points [m] spread evenly over the part of W that matters, the same every time.

    They are a Kronecker sequence with the powers of the plastic number's generalisation, which fills a box evenly.
    """
    lower, upper = bounding_box(area.shape)
    dimension = lower.size
    ratio = 2.0
    for _ in range(64):
        ratio = (1.0 + ratio) ** (1.0 / (dimension + 1))
    step = ratio ** -np.arange(1.0, dimension + 1.0)
    found: list[FloatArray] = []
    count = 0
    for turn in range(_ROUNDS):
        number = np.arange(turn * POINTS + 1.0, (turn + 1.0) * POINTS + 1.0)
        point = lower + (0.5 + number[:, None] * step) % 1.0 * (upper - lower)
        point = point[contains(area.shape, point)]
        found.append(point[cell_weights(area, point, lower, upper) > 0.0])
        count += found[-1].shape[0]
        if count >= POINTS:
            break
    return np.concatenate(found)[:POINTS]
