"""An estimate of the time that outstanding work takes: whether a plan found within one step is worth flying.

When an agent turns out to be slow, or is lost, the plan that a step has time for follows the old division of the work.
The estimate tells what a thorough plan would take: the swath bound of what is left, by the fleet as it is now, times
the ratio to that bound of the plan that was found thoroughly before.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.model.fleet_constraints import FleetConstraints


def work_bound(
    fleet: FleetConstraints,
    cell: FloatArray,
    cell_size: float,
    demand: tuple[FloatArray, IntArray | None],
    position: FloatArray,
) -> float:
    """Return about the least time [s] in which a fleet at `position` (m, d) [m] can measure what is owed.

    The larger of the swath bound and the way to the farthest cell. `cell` is (K, d) [m], `demand` weights and looks
    (J, K), looks None for one each; 0 where nothing is owed.
    """
    weight, looks = demand
    owed = weight > 0.0
    if not owed.any():
        return 0.0
    speed, active = fleet.speed_max, fleet.is_active
    able = np.isfinite(fleet.radius) & active[:, None]  # (m, J)
    radius = np.where(able, fleet.radius, 0.0)
    section = 2.0 * radius if fleet.dimension == 2 else np.pi * radius**2  # noqa: PLR2004 - the plane
    volume = (owed if looks is None else np.where(owed, looks, 0)).sum(axis=1) * cell_size**fleet.dimension
    rate = (section * speed[:, None]).sum(axis=0)
    swath = np.divide(volume, rate, out=np.zeros_like(rate), where=rate > 0.0).max()
    least = 0.0
    for magnitude in range(weight.shape[0]):
        left, who = cell[owed[magnitude]], np.flatnonzero(able[:, magnitude])
        if len(left) and len(who):
            distance = np.linalg.norm(left[:, None] - position[who], axis=2) - radius[who, magnitude]
            least = max(least, float((np.maximum(distance, 0.0) / speed[who]).min(axis=1).max()))
    return max(float(swath), least)
