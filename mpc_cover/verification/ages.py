"""The ages of a patrol's looks, computed anew from the positions, and their limit where the mission is strict.

`age_limit_s` is how long a look is as good as new; the fleet patrols so as to renew it by then, but no fleet is fast
enough for every field. It is a requirement only with `strict: true`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.mission.information import AgeingInformation
from mpc_cover.verification.left_out import with_left_out_looks
from mpc_cover.verification.loss_evidence import of_the_living
from mpc_cover.verification.losses import losses_of
from mpc_cover.verification.report import Check, CheckName
from mpc_cover.verification.resolution import Resolution

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.trajectory_file import Recording

_TIE = 1e-9
"""A cell at distance exactly rho counts as measured, in spite of rounding [m]."""
_SAME_TIME = 1e-6
_EXACT = Resolution()


def check_ages(trajectory: Recording, resolution: Resolution = _EXACT) -> list[Check]:
    """Check that no cell went without a look for longer than a strict patrol's limit; nothing for other missions."""
    given = trajectory.mission.spec.information
    if not isinstance(given, AgeingInformation) or not given.strict:
        return []
    seen = of_the_living(with_left_out_looks(trajectory, resolution.time_s), losses_of(trajectory))
    gap, until = longest_gaps(seen, resolution.length)
    j, k = np.unravel_index(int(np.argmax(gap)), gap.shape)
    margin = given.age_limit_s - float(gap[j, k])
    cell = ", ".join(f"{x:.3g}" for x in trajectory.cell[k])
    where = f"{trajectory.mission.fleet.magnitudes[j]}, cell {k} at ({cell}), no look for {gap[j, k]:.2f} s until "
    where += f"t = {until[j, k]:.2f} s"
    return [Check(CheckName.AGE_LIMIT, margin >= -_SAME_TIME - 2.0 * resolution.time_s, margin, "s", where)]


def longest_gaps(trajectory: Recording, doubt: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Return (J, K) [s] the longest time without a look at each magnitude and cell, and until when (J, K) [s].

    The start of the record counts as a look, and its end ends the last gap. Cells count as in range up to `doubt` [m]
    beyond the radius.
    """
    radius = trajectory.mission.fleet.radius.T  # (J, m)
    last = np.full((radius.shape[0], len(trajectory.cell)), float(trajectory.time[0]))
    gap, until = np.zeros_like(last), last.copy()
    for time, position in zip(trajectory.time, trajectory.position, strict=True):
        longer = time - last > gap
        gap, until = np.where(longer, time - last, gap), np.where(longer, time, until)
        distance = np.linalg.norm(trajectory.cell[:, None] - position, axis=2)  # (K, m)
        seen = (distance[None] <= radius[:, None] + _TIE + doubt).any(axis=2)
        last[seen] = time
    return gap, until
