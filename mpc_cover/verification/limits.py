"""Checks of each agent's path by itself: dynamics, speed, input, box, start and rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.verification.report import Check, CheckName

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.verification.path import Path


def smallest(
    name: CheckName, slack: FloatArray, unit: str, *, time: FloatArray, ids: tuple[str, ...], tolerance: float = 0.0
) -> Check:
    """Return the check whose margin is the smallest of the (n, m) slacks, at (n,) times [s]."""
    row, agent = np.unravel_index(int(np.argmin(slack)), slack.shape)
    margin = float(slack[row, agent])
    return Check(name, margin >= -tolerance, margin, unit, f"{ids[agent]}, t = {time[row]:.3f} s")


def check_dynamics(path: Path, ids: tuple[str, ...], tolerance: float) -> list[Check]:
    """Check that each sample follows from the one before: q+ = q + h v + h^2/2 u, v+ = v + h u  (4.23)."""
    step = path.step
    moved = path.position[:-1] + step * path.velocity[:-1] + 0.5 * step**2 * path.force
    turned = path.velocity[:-1] + step * path.force
    residual_m = np.linalg.norm(path.position[1:] - moved, axis=2)
    residual_m_per_s = np.linalg.norm(path.velocity[1:] - turned, axis=2)
    return [
        smallest(CheckName.DYNAMICS_POSITION, tolerance - residual_m, "m", time=path.time[1:], ids=ids),
        smallest(CheckName.DYNAMICS_VELOCITY, tolerance - residual_m_per_s, "m/s", time=path.time[1:], ids=ids),
    ]


def check_speed(path: Path, fleet: Fleet, tolerance: float) -> Check:
    """Check |v| <= v_max (3.12): the norm of v + t u is convex in t, so that it is largest at a sample."""
    slack = fleet.speed_max - np.linalg.norm(path.velocity, axis=2)
    return smallest(CheckName.SPEED, slack, "m/s", time=path.time, ids=fleet.ids, tolerance=tolerance)


def check_input(path: Path, fleet: Fleet, tolerance: float) -> Check:
    """Check |u| <= u_max (3.11)."""
    slack = fleet.input_max - np.linalg.norm(path.force, axis=2)
    return smallest(CheckName.INPUT, slack, "m/s^2", time=path.time[:-1], ids=fleet.ids, tolerance=tolerance)


def check_box(path: Path, fleet: Fleet, tolerance: float) -> Check:
    """Check that agents stay in their box (3.13, 3.14): each axis is a parabola that may turn between samples."""
    velocity, force = path.velocity[:-1], path.force
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        turn = -velocity / force
    inside = np.isfinite(turn) & (turn > 0.0) & (turn < path.step)
    turn = np.where(inside, turn, 0.0)
    vertex = path.position[:-1] + turn * (velocity + 0.5 * turn * force)
    point = np.concatenate([path.position, vertex])
    slack = np.minimum(point - fleet.motion_min, fleet.motion_max - point).min(axis=2)
    time = np.concatenate([path.time, path.time[:-1]])
    return smallest(CheckName.BOX, slack, "m", time=time, ids=fleet.ids, tolerance=tolerance)


def check_rest(path: Path, ids: tuple[str, ...], tolerance: float) -> Check:
    """Check that all agents stand still at the end (3.15)."""
    slack = tolerance - np.linalg.norm(path.velocity[-1:], axis=2)
    return smallest(CheckName.REST, slack, "m/s", time=path.time[-1:], ids=ids)


def check_start(
    path: Path, start: tuple[FloatArray, FloatArray], ids: tuple[str, ...], tolerance: float
) -> list[Check]:
    """Check that the path starts in the (m, d) position [m] and velocity [m/s] it was asked to start in."""
    position, velocity = start
    away = np.linalg.norm(path.position[:1] - position, axis=2)
    faster = np.linalg.norm(path.velocity[:1] - velocity, axis=2)
    return [
        smallest(CheckName.START_POSITION, tolerance - away, "m", time=path.time[:1], ids=ids),
        smallest(CheckName.START_VELOCITY, tolerance - faster, "m/s", time=path.time[:1], ids=ids),
    ]
