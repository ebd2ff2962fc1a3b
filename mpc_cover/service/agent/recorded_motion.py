"""The motion that an agent's own record holds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.trajectory import Trajectory
from mpc_cover.service.agent.schedule import STANDSTILL

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.service.agent.recorder import Piece


def motion_of(pieces: Sequence[Piece]) -> Trajectory:
    """Return a record's motion; pieces of no duration are left out."""
    kept = lasting(pieces)
    return Trajectory(
        np.array([piece.time_s for piece in kept]),
        np.array([piece.position for piece in kept]),
        np.array([piece.velocity for piece in kept]),
        np.array([piece.input for piece in kept])[:-1],
    )


def rests_from(motion: Trajectory) -> float:
    """Return when an agent came to rest for good [s]; the end of its record if it never did."""
    fast = np.asarray((np.abs(motion.velocity) > STANDSTILL).any(axis=1))
    fast[:-1] |= (np.abs(motion.input) > STANDSTILL).any(axis=1)
    moving = np.flatnonzero(fast)
    return float(motion.time[min(moving[-1] + 1, motion.steps)] if moving.size else motion.time[0])


def lasting(pieces: Sequence[Piece]) -> list[Piece]:
    """Return the pieces of some duration, and the last one."""
    lasts = np.append(np.diff([piece.time_s for piece in pieces]) > 0.0, True)
    return [piece for piece, good in zip(pieces, lasts, strict=True) if good]
