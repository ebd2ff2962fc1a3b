"""Residuals of the dynamics in sum: each may be rounding, and thousands of them a motion that nobody's inputs made."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.verification.limits import smallest
from mpc_cover.verification.report import Check, CheckName

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.verification.path import Path
    from mpc_cover.verification.resolution import Resolution

_TOLERANCES = 10.0
"""How many tolerances of a residual their sum may reach. Plain choice: sums of 200 recorded flights stayed below 1e-6
tolerances."""
_DIGITS = 4.0
"""Rounding of an interval's residual, in last digits of the largest coordinate: three products and sums; derived."""


def check_residual_sums(path: Path, ids: tuple[str, ...], tolerance: float, resolution: Resolution) -> list[Check]:
    """Check that no agent's residuals (4.23), summed as vectors from the start to any sample, come to a motion.

    `tolerance` is that of a residual [m], [m/s].
    """
    step = path.step
    moved = path.position[1:] - (path.position[:-1] + step * path.velocity[:-1] + 0.5 * step**2 * path.force)
    turned = path.velocity[1:] - (path.velocity[:-1] + step * path.force)
    number = np.arange(1.0, 1.0 + moved.shape[0])[:, None]
    bounds = (
        _TOLERANCES * tolerance + resolution.position_sum + _DIGITS * number * _digit(path.position),
        _TOLERANCES * tolerance + resolution.velocity_sum + _DIGITS * number * _digit(path.velocity),
    )
    names = (CheckName.POSITION_SUM, "m"), (CheckName.VELOCITY_SUM, "m/s")
    return [
        smallest(name, bound - np.linalg.norm(np.cumsum(residual, axis=0), axis=2), unit, time=path.time[1:], ids=ids)
        for (name, unit), bound, residual in zip(names, bounds, (moved, turned), strict=True)
    ]


def _digit(values: FloatArray) -> float:
    return float(np.spacing(np.abs(values).max()))
