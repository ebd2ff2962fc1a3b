"""Flying through waypoints within the limits: how a path becomes a motion that a QP can start from."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.trajectory import Trajectory

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.mission.fleet import Fleet

_CRUISE = 0.97
"""Part of the speed and input limits that guesses use: room for the SQP."""


_CATCH_UP = 0.5
"""Part of the way to where one should be that is made up for in a sample."""


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
    max_steps: int = 2000,
) -> Trajectory:
    """Fly each agent along its (W_i, d) waypoints [m] and come to rest at the last.

    With `steps` the motion has that many and is at rest at the end, arrived or not (unless `stop` is false);
    without, it is as long as the last arrival needs. An agent turns to the next waypoint at the distance in
    which it could stop. Start at (m, d) `position` [m] and `velocity` [m/s]; inputs stay within their limits unless the
    start's velocity leaves no choice.
    """
    count = fleet.size
    speed, force = _CRUISE * fleet.speed_max, _CRUISE * fleet.input_max
    capture = 0.5 * speed**2 / force
    ends = np.array([len(path) - 1 for path in paths], dtype=np.intp)
    target_of = np.full((count, int(ends.max()) + 1, position.shape[1]), np.nan)
    for i, path in enumerate(paths):
        target_of[i, : len(path)] = path
    index = np.zeros(count, dtype=np.intp)
    every = np.arange(count)
    q, v = position.astype(float), velocity.astype(float)
    qs, vs = [q], [v]
    total = steps or max_steps
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


def track_samples(
    wanted: FloatArray, position: FloatArray, velocity: FloatArray, fleet: Fleet, period: float, start_time: float = 0.0
) -> Trajectory:
    """Be where `wanted` (N+1, m, d) [m] says at its samples, as nearly as limits allow, and come to rest after them.

    Start as in `track_waypoints`. What is wanted is smoothed over a sample to either side.
    """
    speed, force = _CRUISE * fleet.speed_max, _CRUISE * fleet.input_max
    padded = np.concatenate([wanted[:1], wanted, wanted[-1:], wanted[-1:]])
    smooth = 0.25 * (padded[:-3] + 2.0 * padded[1:-2] + padded[2:-1])
    ahead = 0.5 * (padded[3:] - padded[1:-2]) / period  # velocities under which positions are the smooth ones
    q, v = position.astype(float), velocity.astype(float)
    qs, vs = [q], [v]
    for here, then in zip(smooth, ahead, strict=True):
        aim = _clipped(then + _CATCH_UP * (here - q) / period, speed)
        u = _stay_inside(q, v, _clipped((aim - v) / period, force), fleet, force, period)
        q, v = q + period * v + 0.5 * period**2 * u, v + period * u
        qs.append(q)
        vs.append(v)
    return _trajectory(qs, vs, force, start_time, period)


def _arrived(index: IntArray, ends: IntArray, distance: FloatArray, v: FloatArray, fleet: Fleet, period: float) -> bool:
    close = distance < 0.2 * fleet.speed_max * period + 0.05
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
    """Aim at the waypoint with full speed, slowing down for the last one, and for one that a sample would pass by.

    A sample that is longer than the distance at which agents turn may end on the far side of the waypoint, the next
    one where it was before, and so on for ever.
    """
    landing = np.minimum(speed, distance / period)
    wanted = np.where(last, np.minimum(landing, np.sqrt(0.9 * force * distance)), landing)
    aim = error / np.maximum(distance, 1e-9)[:, None] * wanted[:, None]
    return _clipped((aim - v) / period, force)


def _stay_inside(
    q: FloatArray, v: FloatArray, u: FloatArray, fleet: Fleet, force: FloatArray, period: float
) -> FloatArray:
    """Slow down towards the walls of the motion box, axis by axis."""
    half = 0.5 * force[:, None]
    for wall, sign in ((fleet.motion_max, 1.0), (fleet.motion_min, -1.0)):
        room = np.maximum(sign * (wall - q), 0.0)
        limit = np.minimum(np.sqrt(half * room), room / period)  # half the force brakes, half is left for the rest
        over = sign * (v + period * u) > limit
        u = np.where(over, (sign * limit - v) / period, u)
    return _clipped(u, force)


def _in_time(v: FloatArray, u: FloatArray, force: FloatArray, period: float, left: int) -> FloatArray:
    """Keep the speed such that the steps left suffice to stop.

    Whoever would be too fast goes as far from straight braking towards what was wanted as the speed allows;
    both lie within the input's ball, and so does all between them.
    """
    brake = 0.9 * force * period
    cap = brake * (left - 1)
    size = np.linalg.norm(v, axis=1)
    safe = v * np.maximum(1.0 - brake / np.maximum(size, 1e-12), 0.0)[:, None]
    toward = v + period * u - safe
    a, b, c = (np.einsum("id,id->i", x, y) for x, y in ((toward, toward), (safe, toward), (safe, safe)))
    root = np.sqrt(np.maximum(b * b - a * (c - cap**2), 0.0))
    part = np.where(a > 0.0, (root - b) / np.maximum(a, 1e-18), 1.0)
    return np.asarray((safe + np.clip(part, 0.0, 1.0)[:, None] * toward - v) / period)


def _trajectory(
    position: list[FloatArray], velocity: list[FloatArray], force: FloatArray | None, start_time: float, period: float
) -> Trajectory:
    """Return the motion through samples; with `force` (m,) [m/s^2] to brake with, brought to rest after them."""
    if force is not None:
        _append_stop(position, velocity, force, period)
    velocities = np.array(velocity)
    return Trajectory.even(start_time, period, np.array(position), velocities, np.diff(velocities, axis=0) / period)


def _append_stop(position: list[FloatArray], velocity: list[FloatArray], force: FloatArray, period: float) -> None:
    """Append samples that bring everyone to rest."""
    q, v = position[-1], velocity[-1]
    while np.abs(v).max() > 0.0:
        size = np.linalg.norm(v, axis=1)
        left = np.maximum(size - force * period, 0.0) / np.maximum(size, 1e-12)
        after = v * left[:, None]
        q = q + 0.5 * period * (v + after)
        v = after
        position.append(q)
        velocity.append(v)


def _clipped(u: FloatArray, force: FloatArray) -> FloatArray:
    size = np.linalg.norm(u, axis=1)
    return np.asarray(u * np.minimum(1.0, force / np.maximum(size, 1e-12))[:, None])
