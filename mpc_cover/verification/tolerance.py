"""The verifier's tolerance: relative to the fleet's sensing radius, and never below the rounding of coordinates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.mission.fleet import Fleet

TOLERANCE = 1e-6
"""Tolerance of limits and residuals in sensing radii, and those a second and a second squared; a plain choice."""
_ROUNDING = 16.0
"""Rounding errors of coordinates that are tolerated, in units of their last digit; a plain choice."""


def tolerance_of(fleet: Fleet) -> float:
    """Return the tolerance of limits and of residuals of a fleet's motions [m, m/s, m/s^2]."""
    measuring = fleet.radius[np.isfinite(fleet.radius) & (fleet.radius > 0.0)]
    length = float(measuring.min()) if measuring.size else 1.0
    farthest = np.abs(np.concatenate([fleet.motion_min, fleet.motion_max])).max()
    return TOLERANCE * length + _ROUNDING * float(np.spacing(farthest))
