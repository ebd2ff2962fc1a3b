"""Bounds on the time to cover an area, by how much new area sensing discs can sweep in a time.

They count area, not cells: motions that see all cells may leave slivers of area between them, and be a little faster.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission

_LOOKS_MAX = 100_000
"""Looks of an agent up to which they are summed up; a plain choice, beyond every mission that is flown."""


def swath_bound(mission: Mission, look_s: float = 0.0) -> float | None:
    """Return T_b = (A - sum pi rho_i^2) / sum_i min(2 rho_i v_i, pi rho_i^2 / look_s) [s]; None outside the plane.

    Each agent starts with its disc and sweeps a strip 2 rho wide; what is left of A takes about this long. A look
    adds a disc at most, however fast the agent is, one every `look_s` [s]. None for several magnitudes.
    """
    fleet = mission.fleet
    if fleet.dimension != 2 or fleet.radius.shape[1] != 1:  # noqa: PLR2004 - the plane
        return None
    radius = np.maximum(fleet.radius[:, 0], 0.0)
    left = mission.field.measure - float(np.pi * (radius**2).sum())
    rate = 2.0 * radius * fleet.speed_max
    if look_s > 0.0:
        rate = np.minimum(rate, np.pi * radius**2 / look_s)
    return left / float(rate.sum()) if left > 0.0 else None


def bound_from_rest(mission: Mission, look_s: float = 0.0) -> float | None:
    """Return the least time [s] in which discs that start at rest can see an area as large as W; None as `swath_bound`.

    With u_max an agent is no farther than u t^2 / 2 after t, then v_max t - v^2 / (2 u). Two looks a way s apart see at
    most the new area pi rho^2 - L(s), L the lens that two discs of radius rho share; a continuous sensor 2 rho s. Turns
    are not counted. No motion of agents at rest at the start sees as much area in less time.
    """
    swept = swath_bound(mission, look_s)
    if swept is None:
        return None
    fleet, radius = mission.fleet, np.maximum(mission.fleet.radius[:, 0], 0.0)
    left = mission.field.measure - float(np.pi * (radius**2).sum())
    longest = swept + float((fleet.speed_max / fleet.input_max).max())
    if look_s <= 0.0:
        low, high = 0.0, longest
        for _ in range(60):
            middle = 0.5 * (low + high)
            way = _way_from_rest(np.array([middle]), fleet.speed_max, fleet.input_max)[0]
            low, high = (low, middle) if float(2.0 * radius @ way) >= left else (middle, high)
        return high
    looks = min(_LOOKS_MAX, 2 * math.ceil(longest / look_s) + 2)
    way = _way_from_rest(look_s * np.arange(looks + 1.0, dtype=np.float64), fleet.speed_max, fleet.input_max)
    gain = np.cumsum(_new_area(np.diff(way, axis=0), radius).sum(axis=1))
    enough = int(np.searchsorted(gain, left * (1.0 - 1e-12)))
    return look_s * (enough + 1) if enough < looks else swept


def _way_from_rest(time: FloatArray, speed: FloatArray, force: FloatArray) -> FloatArray:
    """Return how far (T, m) [m] agents come in (T,) times [s] at most; limits (m,) [m/s], [m/s^2]."""
    ramp = np.minimum(time[:, None], speed / force)
    return np.asarray(0.5 * force * ramp**2 + speed * (time[:, None] - ramp))


def _new_area(way: FloatArray, radius: FloatArray) -> FloatArray:
    """Return what discs of radius (m,) [m] cover beyond those a way (T, m) [m] before them [m^2]."""
    half = np.clip(0.5 * way / np.where(radius > 0.0, radius, 1.0), 0.0, 1.0)
    lens = 2.0 * (np.arccos(half) - half * np.sqrt(1.0 - half**2))
    return np.asarray((np.pi - lens) * radius**2)
