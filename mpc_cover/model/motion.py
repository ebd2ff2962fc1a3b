"""The double integrator under a zero-order hold, exactly (thesis 3.1, 3.17, 4.23)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray


def roll_out(
    position: FloatArray, velocity: FloatArray, force: FloatArray, period: float
) -> tuple[FloatArray, FloatArray]:
    """Return the motion (N+1, m, d) of positions [m] and velocities [m/s] under inputs (N, m, d) [m/s^2].

    `position` and `velocity` are the (m, d) state at sample 0. Exact for inputs held over `period` [s]:
    q+ = q + T v + T^2/2 u, v+ = v + T u  (3.17, 4.23).
    """
    steps = force.shape[0]
    velocities = np.empty((steps + 1, *position.shape))
    positions = np.empty_like(velocities)
    velocities[0] = velocity
    positions[0] = position
    np.cumsum(period * force, axis=0, out=velocities[1:])
    velocities[1:] += velocity
    np.cumsum(period * velocities[:-1] + 0.5 * period**2 * force, axis=0, out=positions[1:])
    positions[1:] += position
    return positions, velocities


def chord_deviation(input_max: FloatArray, seconds: float | FloatArray) -> FloatArray:
    """Return (m,) [m]: how far a path of `seconds` [s] leaves its chord at most, u_max t^2 / 8; (m,) [m/s^2]."""
    return np.asarray(input_max * np.square(seconds) / 8.0)


def time_from_rest(distance: FloatArray, speed_max: FloatArray | float, input_max: FloatArray | float) -> FloatArray:
    """Return the least time [s] in which a double integrator travels each distance [m] straight, from rest.

    It accelerates at `input_max` [m/s^2], and cruises at `speed_max` [m/s]; it does not stop. Shapes broadcast.
    """
    cruising = distance / speed_max + 0.5 * speed_max / input_max
    fast = distance > 0.5 * speed_max**2 / input_max
    return np.where(fast, cruising, np.sqrt(2.0 * distance / input_max))


def path_extremes(position: FloatArray, velocity: FloatArray, period: float) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and the highest coordinates (N, m, d) [m] within each interval of a motion.

    Each coordinate is a parabola under a zero-order hold, with its vertex at t = -v/u: q - v^2 / (2 u).
    """
    force = np.diff(velocity, axis=0) / period
    before, after = velocity[:-1], velocity[1:]
    turns = before * after < 0.0
    vertex = position[:-1] - np.divide(before**2, 2.0 * force, out=np.zeros_like(force), where=turns)
    low, high = np.minimum(position[:-1], position[1:]), np.maximum(position[:-1], position[1:])
    return np.where(turns, np.minimum(low, vertex), low), np.where(turns, np.maximum(high, vertex), high)
