"""Braking as hard as possible, straight on: what a deadman does, and the last resort of a fleet."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.trajectory import Trajectory

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.fleet import Fleet

_STANDING = 1e-9


def braking_position(
    position: FloatArray, velocity: FloatArray, later: FloatArray, input_max: FloatArray
) -> FloatArray:
    """Return where (G, C, d) [m] those from (C, d) are `later` (G,) [s], braking as hard as they can (C,) [m/s^2]."""
    speed = np.linalg.norm(velocity, axis=1)
    time = np.minimum(later[:, None], (speed / input_max)[None])
    way = time - 0.5 * time**2 * input_max / np.maximum(speed, _STANDING)
    return np.asarray(position[None] + way[:, :, None] * velocity[None])


def braking_distance_gradient(
    normal: FloatArray, velocity: FloatArray, later: FloatArray, input_max: FloatArray
) -> FloatArray:
    """Return the gradient (C, d) [s] of the way along `normal` that braking takes `later` (C,) [s] on, by velocity."""
    speed = np.maximum(np.linalg.norm(velocity, axis=1), _STANDING)
    heading = velocity / speed[:, None]
    along = np.einsum("cd,cd->c", normal, heading)[:, None] * heading
    time, stops_in = later[:, None], (speed / input_max)[:, None]
    rolled = np.minimum(time, stops_in)
    rolling = rolled * normal - rolled**2 / (2.0 * stops_in) * (normal - along)
    standing = 0.5 * stops_in * (normal + along)
    return np.asarray(np.where(time < stops_in, rolling, standing))


def braking_velocities(velocity: FloatArray, fleet: Fleet, period: float) -> FloatArray:
    """Return (B, m, d) velocities [m/s] at samples 1 to B of the hardest straight braking from (m, d); B >= 1."""
    speed = np.linalg.norm(velocity, axis=1)
    slower = fleet.input_max * period * (1.0 - 1e-9)
    count = max(1, int(np.ceil((speed / slower).max() - 1e-9)))
    share = np.maximum(speed[None] - np.arange(1, count + 1)[:, None] * slower[None], 0.0)
    share /= np.maximum(speed, 1e-12)[None]
    share[-1] = 0.0
    return np.asarray(share[:, :, None] * velocity[None])


def braking_trajectory(
    position: FloatArray, velocity: FloatArray, fleet: Fleet, start_time: float, period: float, steps: int
) -> Trajectory:
    """Return the motion from (m, d) that brakes as hard as it may, then stays: `steps` samples, or as it needs."""
    braking = braking_velocities(velocity, fleet, period)
    rest = np.zeros((max(0, steps - braking.shape[0]), *velocity.shape))
    later = np.concatenate([braking, rest])
    return Trajectory.from_velocities(position, velocity, later, start_time, period)
