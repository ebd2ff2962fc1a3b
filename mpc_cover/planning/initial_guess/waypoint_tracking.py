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
_CUT_MAX = 1.0
"""Distance from a waypoint at which an agent turns, at the most, in sensing radii: what it cuts off is still measured
nearly everywhere. Plain choice."""
_LONG_LEG, _AHEAD = 24.0, 3.0
"""Length of legs, in sensing radii, that are followed along their line, and how far ahead on it agents aim; plain
choices."""
_TURN_SHARE = 0.7
"""Part of the input limit that slows agents down before they turn; a plain choice."""
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
    agent turns to the next waypoint at its stopping distance; where that would cut too much off, it slows down first.
    The initial state is (m, d) `position` [m] and `velocity` [m/s]; inputs stay within their limits unless the initial
    velocity makes that impossible.
    """
    count = fleet.size
    speed, force = LIMIT_SHARE * fleet.speed_max, LIMIT_SHARE * fleet.input_max
    radius = _smallest_radius(fleet)
    stopping = 0.5 * speed**2 / force
    capture = np.minimum(stopping, _CUT_MAX * radius)
    ends = np.array([len(path) - 1 for path in paths], dtype=np.intp)
    target_of = np.full((count, int(ends.max()) + 1, position.shape[1]), np.nan)
    for i, path in enumerate(paths):
        target_of[i, : len(path)] = path
    leg_start = np.concatenate([position[:, None], target_of[:, :-1]], axis=1)
    turning = _turning_speeds(target_of, position, capture, force)
    turning[stopping <= capture] = np.inf  # who cuts off no more than that need not slow down
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
        aim = _on_leg(q, leg_start[every, index], target_of[every, index], radius)
        if steps is None and n > 0 and _arrived(index, ends, distance, v, fleet, period):
            break
        ahead_m = np.maximum(distance - capture, 0.0)
        limit = np.minimum(speed, np.sqrt(turning[every, index] ** 2 + 2.0 * _TURN_SHARE * force * ahead_m))
        u = _control(aim - q, distance, v, index == ends, limit, force, period)
        u = _stay_inside(q, v, u, fleet, force, period)
        if steps is not None and stop:
            u = _in_time(v, u, force, period, total - n)
        q, v = q + period * v + 0.5 * period**2 * u, v + period * u
        qs.append(q)
        vs.append(v)
    return _trajectory(qs, vs, None if steps is not None else force, start_time, period)


def _smallest_radius(fleet: Fleet) -> FloatArray:
    """Return (m,) [m]: the smallest sensing radius of each agent; inf where it measures nothing."""
    return np.asarray(np.where(np.isfinite(fleet.radius), fleet.radius, np.inf).min(axis=1))


def _on_leg(q: FloatArray, start: FloatArray, goal: FloatArray, radius: FloatArray) -> FloatArray:
    """Return the points (m, d) [m] to fly towards: on long legs ones on the leg a little ahead, else their ends.

    Who flew straight to the end of a long leg would come back to it only there, and leave cells along it.
    """
    leg = goal - start
    length = np.linalg.norm(leg, axis=1)
    along = ((q - start) * leg).sum(axis=1) / np.maximum(length, DIVISOR_MIN)
    ahead = np.clip(along, 0.0, length) + _AHEAD * radius
    short = ~((length > _LONG_LEG * radius) & (ahead < length))
    part = np.where(short, 1.0, ahead / np.maximum(length, DIVISOR_MIN))
    return np.asarray(np.where(short[:, None], goal, start + part[:, None] * leg))


def _turning_speeds(target: FloatArray, position: FloatArray, capture: FloatArray, force: FloatArray) -> FloatArray:
    """Return the speeds (m, W) [m/s] at which agents turn at their waypoints (m, W, d) [m]; inf where they do not.

    Under a constant input f an agent rounds a corner by the angle theta within c of it at v^2 = f c / sin(theta / 2).
    """
    legs = np.diff(np.concatenate([position[:, None], target], axis=1), axis=1)  # (m, W, d), NaN beyond the end
    length = np.maximum(np.linalg.norm(legs, axis=2), DIVISOR_MIN)
    cosine = (legs[:, :-1] * legs[:, 1:]).sum(axis=2) / (length[:, :-1] * length[:, 1:])
    sine = np.sqrt(np.clip(0.5 * (1.0 - cosine), 0.0, 1.0))  # of half the angle
    speed = np.full(target.shape[:2], np.inf)
    speed[:, :-1] = np.where(
        np.isnan(sine), np.inf, np.sqrt((force * capture)[:, None] / np.maximum(sine, DIVISOR_MIN))
    )
    return speed


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
    ahead: FloatArray,
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
    aim = ahead / np.maximum(np.linalg.norm(ahead, axis=1), NO_DIRECTION)[:, None] * wanted[:, None]
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
