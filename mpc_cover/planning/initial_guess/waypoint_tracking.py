"""Waypoint tracking within speed and input limits: turns paths into motions from which the solver can start."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.tolerances import AT_REST, DIVISOR_MIN, NO_DIRECTION
from mpc_cover.model.trajectory import Trajectory

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.mission.fleet import Fleet

LIMIT_SHARE = 0.97
"""Part of the speed and input limits that initial guesses use, so that the SQP has freedom; a plain choice."""
_CORRECTION_SHARE = 0.5
"""Part of the position error that `track_samples` corrects per sample; a plain choice."""
_MAX_STEPS, _MAX_PATHS = 2000, 3.0
"""Steps after which tracking without a given length ends, and those in units of the time for the longest path at full
speed, whichever are more; plain choices."""
_ARRIVED_STEPS, _ARRIVED_M = 0.2, 0.05
"""Distance at which a last waypoint counts as reached: part of a step at full speed plus a length [m]; plain choice."""
_APPROACH_SHARE = 0.9
"""v^2 / (u_max d) of the approach to a last waypoint at distance d: less than half of u_max brakes. Plain choice."""
_STOP_SHARE = 0.9
"""Part of the input limit that braking in time may take; a plain choice."""
_WALL_SHARE = 0.5
"""Part of the input limit that brakes in front of the walls of the motion box; the rest is for the other axes."""


def track_waypoints(
    paths: Sequence[FloatArray],
    position: FloatArray,
    velocity: FloatArray,
    fleet: Fleet,
    period: float,
    *,
    start_time: float = 0.0,
    steps: int | None = None,
    stop: bool = True,
    max_steps: int | None = None,
) -> Trajectory:
    """Return the motion of agents along their (W_i, d) waypoints [m] that comes to rest at the last ones.

    With `steps` the motion has that many and is at rest at the end, arrived or not (unless `stop` is false);
    without, it is as long as the last arrival needs, but at most `max_steps` (None: more than any path takes). An
    agent turns to the next waypoint at its stopping distance. The initial state is (m, d) `position` [m] and
    `velocity` [m/s]; inputs stay within their limits unless the initial velocity makes that impossible.
    """
    count = fleet.size
    speed, force = LIMIT_SHARE * fleet.speed_max, LIMIT_SHARE * fleet.input_max
    capture = 0.5 * speed**2 / force
    ends = np.array([len(path) - 1 for path in paths], dtype=np.intp)
    target_of = np.full((count, int(ends.max()) + 1, position.shape[1]), np.nan)
    for i, path in enumerate(paths):
        target_of[i, : len(path)] = path
    index = np.zeros(count, dtype=np.intp)
    every = np.arange(count)
    q, v = position.astype(float), velocity.astype(float)
    qs, vs = [q], [v]
    total = steps or max_steps or _most_steps(paths, position, speed, period)
    for n in range(total):
        for _ in range(int(ends.max()) + 1):
            near = np.linalg.norm(target_of[every, index] - q, axis=1) < capture
            ahead = near & (index < ends)
            if not ahead.any():
                break
            index = np.where(ahead, index + 1, index)
        error = target_of[every, index] - q
        distance = np.linalg.norm(error, axis=1)
        if steps is None and n > 0 and _arrived(index, ends, distance, v, fleet, period):
            break
        u = _control(error, distance, v, index == ends, speed, force, period)
        u = _stay_inside(q, v, u, fleet, force, period)
        if steps is not None and stop:
            u = _in_time(v, u, force, period, total - n)
        q, v = q + period * v + 0.5 * period**2 * u, v + period * u
        qs.append(q)
        vs.append(v)
    return _trajectory(qs, vs, None if steps is not None else force, start_time, period)


def _most_steps(paths: Sequence[FloatArray], position: FloatArray, speed: FloatArray, period: float) -> int:
    """Return a number of steps in which agents come to the ends of their paths, however long."""
    whole = (np.concatenate([here[None], path]) for here, path in zip(position, paths, strict=True))
    length = np.array([np.linalg.norm(np.diff(path, axis=0), axis=1).sum() for path in whole])
    return max(_MAX_STEPS, int(np.ceil(_MAX_PATHS * float((length / speed).max()) / period)))


def track_samples(
    wanted: FloatArray, position: FloatArray, velocity: FloatArray, fleet: Fleet, period: float, start_time: float = 0.0
) -> Trajectory:
    """Return the motion that tracks positions `wanted` (N+1, m, d) [m] as closely as limits allow, then comes to rest.

    Initial state as in `track_waypoints`. The reference is smoothed over three samples.
    """
    speed, force = LIMIT_SHARE * fleet.speed_max, LIMIT_SHARE * fleet.input_max
    padded = np.concatenate([wanted[:1], wanted, wanted[-1:], wanted[-1:]])
    smooth = 0.25 * (padded[:-3] + 2.0 * padded[1:-2] + padded[2:-1])
    ahead = 0.5 * (padded[3:] - padded[1:-2]) / period  # velocities whose positions are the smooth ones
    q, v = position.astype(float), velocity.astype(float)
    qs, vs = [q], [v]
    for here, then in zip(smooth, ahead, strict=True):
        aim = _clipped(then + _CORRECTION_SHARE * (here - q) / period, speed)
        u = _stay_inside(q, v, _clipped((aim - v) / period, force), fleet, force, period)
        q, v = q + period * v + 0.5 * period**2 * u, v + period * u
        qs.append(q)
        vs.append(v)
    return _trajectory(qs, vs, force, start_time, period)


def _arrived(index: IntArray, ends: IntArray, distance: FloatArray, v: FloatArray, fleet: Fleet, period: float) -> bool:
    close = distance < _ARRIVED_STEPS * fleet.speed_max * period + _ARRIVED_M
    slow = np.linalg.norm(v, axis=1) < fleet.input_max * period
    return bool(((index == ends) & close & slow).all())


def _control(
    error: FloatArray,
    distance: FloatArray,
    v: FloatArray,
    last: BoolArray,
    speed: FloatArray,
    force: FloatArray,
    period: float,
) -> FloatArray:
    """Return inputs (m, d) [m/s^2] towards the waypoints at full speed, slower where a step would pass one.

    Towards the last waypoint agents slow down to stop there. A step longer than the distance at which they turn could
    otherwise alternate between both sides of a waypoint without end.
    """
    landing = np.minimum(speed, distance / period)
    wanted = np.where(last, np.minimum(landing, np.sqrt(_APPROACH_SHARE * force * distance)), landing)
    aim = error / np.maximum(distance, NO_DIRECTION)[:, None] * wanted[:, None]
    return _clipped((aim - v) / period, force)


def _stay_inside(
    q: FloatArray, v: FloatArray, u: FloatArray, fleet: Fleet, force: FloatArray, period: float
) -> FloatArray:
    """Return inputs (m, d) [m/s^2] that slow down towards the walls of the motion box, axis by axis."""
    braking = _WALL_SHARE * force[:, None]
    for wall, sign in ((fleet.motion_max, 1.0), (fleet.motion_min, -1.0)):
        room = np.maximum(sign * (wall - q), 0.0)
        limit = np.minimum(np.sqrt(braking * room), room / period)
        over = sign * (v + period * u) > limit
        u = np.where(over, (sign * limit - v) / period, u)
    return _clipped(u, force)


def _in_time(v: FloatArray, u: FloatArray, force: FloatArray, period: float, left: int) -> FloatArray:
    """Return inputs (m, d) [m/s^2] after which the steps left suffice to stop.

    Where `u` would be too fast, the input is the point nearest to `u` on the segment from straight braking to `u` that
    keeps the speed limit; both ends lie within the input's ball, and so does the segment.
    """
    brake = _STOP_SHARE * force * period
    cap = brake * (left - 1)
    size = np.linalg.norm(v, axis=1)
    safe = v * np.maximum(1.0 - brake / np.maximum(size, DIVISOR_MIN), 0.0)[:, None]
    toward = v + period * u - safe
    a, b, c = (np.einsum("id,id->i", x, y) for x, y in ((toward, toward), (safe, toward), (safe, safe)))
    root = np.sqrt(np.maximum(b * b - a * (c - cap**2), 0.0))
    part = np.where(a > 0.0, (root - b) / np.maximum(a, AT_REST**2), 1.0)
    return np.asarray((safe + np.clip(part, 0.0, 1.0)[:, None] * toward - v) / period)


def _trajectory(
    position: list[FloatArray], velocity: list[FloatArray], force: FloatArray | None, start_time: float, period: float
) -> Trajectory:
    """Return the motion through samples; with `force` (m,) [m/s^2], extended by braking to rest."""
    if force is not None:
        _append_stop(position, velocity, force, period)
    velocities = np.array(velocity)
    return Trajectory.even(start_time, period, np.array(position), velocities, np.diff(velocities, axis=0) / period)


def _append_stop(position: list[FloatArray], velocity: list[FloatArray], force: FloatArray, period: float) -> None:
    """Append samples that brake all agents to rest."""
    q, v = position[-1], velocity[-1]
    while np.abs(v).max() > 0.0:
        size = np.linalg.norm(v, axis=1)
        left = np.maximum(size - force * period, 0.0) / np.maximum(size, DIVISOR_MIN)
        after = v * left[:, None]
        q = q + 0.5 * period * (v + after)
        v = after
        position.append(q)
        velocity.append(v)


def _clipped(u: FloatArray, force: FloatArray) -> FloatArray:
    size = np.linalg.norm(u, axis=1)
    return np.asarray(u * np.minimum(1.0, force / np.maximum(size, DIVISOR_MIN))[:, None])
