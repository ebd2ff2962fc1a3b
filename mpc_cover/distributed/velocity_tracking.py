"""Double integrators fly the law's velocities within u_max and v_max (3.11, 3.12)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray


def track(
    velocity: FloatArray, wish: FloatArray, input_max: FloatArray, speed_max: FloatArray, period: float
) -> FloatArray:
    """Return inputs (m, d) [m/s^2], held for `period` [s], that bring (m, d) velocities [m/s] nearest to a wish.

    The wish is cut to v_max and the input to u_max, both (m,): the speed at the end of the period is within
    v_max when it is at the start, as any point between the two is.
    """
    force = (limited(wish, speed_max) - velocity) / period
    return limited(force, input_max)


def limited(vector: FloatArray, longest: FloatArray) -> FloatArray:
    """Return (m, ..., d) vectors cut to (m,) lengths (5.2)."""
    length = np.linalg.norm(vector, axis=-1)
    bound = longest.reshape(-1, *[1] * (length.ndim - 1))
    scale = np.divide(bound, length, out=np.ones_like(length), where=length > bound)
    return np.asarray(vector * scale[..., None])
