"""Where agents come to that brake as hard as they can, straight on: what a deadman does."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray

_STANDING = 1e-9


def braked(position: FloatArray, velocity: FloatArray, later: FloatArray, input_max: FloatArray) -> FloatArray:
    """Return where (G, C, d) [m] those from (C, d) are `later` (G,) [s], braking as hard as they can (C,) [m/s^2]."""
    speed = np.linalg.norm(velocity, axis=1)
    time = np.minimum(later[:, None], (speed / input_max)[None])
    way = time - 0.5 * time**2 * input_max / np.maximum(speed, _STANDING)
    return np.asarray(position[None] + way[:, :, None] * velocity[None])


def braking_slope(normal: FloatArray, velocity: FloatArray, later: FloatArray, input_max: FloatArray) -> FloatArray:
    """Return the gradient (C, d) [s] of the way along `normal` that braking takes `later` (C,) [s] on, by velocity."""
    speed = np.maximum(np.linalg.norm(velocity, axis=1), _STANDING)
    heading = velocity / speed[:, None]
    along = np.einsum("cd,cd->c", normal, heading)[:, None] * heading
    time, stops_in = later[:, None], (speed / input_max)[:, None]
    rolled = np.minimum(time, stops_in)
    rolling = rolled * normal - rolled**2 / (2.0 * stops_in) * (normal - along)
    standing = 0.5 * stops_in * (normal + along)
    return np.asarray(np.where(time < stops_in, rolling, standing))
