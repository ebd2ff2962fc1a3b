"""Looks that a thinned record left out: what a sensor saw at their instants follows from the path between samples.

Sensors look once a look interval. A record whose samples are farther apart has left some out, whose instants are
those of its samples moved by look intervals. `doubt_s` is how exactly the record holds times [s].
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.trajectory_file import RecordingKind
from mpc_cover.verification.path import Path

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.trajectory_file import Recording

_SAME_TIME = 1e-6
"""Instants closer than this part of a look interval are the same; a plain choice."""
_MOST = 200_000
"""Instants put in at most: seconds of work. A plain choice; with fewer, honest claims may fail, none passes."""


def look_period(trajectory: Recording) -> float:
    """Return the time between looks [s]: T_s of plans; of flights that between an agent's samples."""
    control = trajectory.mission.spec.control
    planned = trajectory.meta.get("kind") == RecordingKind.PLAN
    return control.period_s if planned else control.inbox_s


def with_claimed_looks(trajectory: Recording, doubt_s: float = 0.0) -> Recording:
    """Return the recording with samples at the instants of left-out looks by which cells are claimed to be covered."""
    claimed = np.unique(trajectory.covered_at[np.isfinite(trajectory.covered_at)])
    period, same = look_period(trajectory), _same_time(trajectory, doubt_s)
    phase, inside = _phases(trajectory, same), claimed[_within_long(trajectory, claimed, same)]
    around = np.concatenate([[phase[-1] - period], phase, [phase[0] + period]])
    after = np.clip(np.searchsorted(around, inside % period), 1, around.size - 1)
    away = np.minimum(np.abs(around[after] - inside % period), np.abs(around[after - 1] - inside % period))
    return with_samples(trajectory, inside[away <= same])


def with_left_out_looks(trajectory: Recording, doubt_s: float = 0.0) -> Recording:
    """Return the recording with samples at the instants of all looks that were left out."""
    period, same = look_period(trajectory), _same_time(trajectory, doubt_s)
    phase, long = _phases(trajectory, same), np.flatnonzero(np.diff(trajectory.time) > period + same)
    count = np.diff(trajectory.time)[long].sum() / period * phase.size
    if not long.size or count > _MOST:
        return trajectory
    pieces = []
    for begin, end in zip(trajectory.time[long], trajectory.time[long + 1], strict=True):
        first = np.ceil((begin - phase) / period)[:, None] + np.arange(np.ceil((end - begin) / period) + 1.0)
        pieces.append((phase[:, None] + period * first).ravel())
    instant = np.unique(np.concatenate(pieces))
    return with_samples(trajectory, instant[_within_long(trajectory, instant, same)])


def with_samples(trajectory: Recording, instant: FloatArray) -> Recording:
    """Return the same motion with further samples at instants (n,) [s] inside of its intervals."""
    if not instant.size:
        return trajectory
    path = Path(trajectory.time, trajectory.position, trajectory.velocity, trajectory.input)
    row = np.searchsorted(path.time, instant, side="right") - 1
    elapsed = (instant - path.time[row])[:, None, None]
    force, speed = path.force[row], path.velocity[row]
    time = np.concatenate([path.time, instant])
    order = np.argsort(time, kind="stable")
    held = np.concatenate([path.force, np.zeros_like(path.force[:1]), force])
    position = np.concatenate([path.position, path.position[row] + elapsed * (speed + 0.5 * elapsed * force)])
    velocity = np.concatenate([path.velocity, speed + elapsed * force])
    return replace(
        trajectory, time=time[order], position=position[order], velocity=velocity[order], input=held[order][:-1]
    )


def _same_time(trajectory: Recording, doubt_s: float) -> float:
    """Return how far apart two instants may be that are the same [s]: each is rounded, and so are those between."""
    return _SAME_TIME * look_period(trajectory) + 4.0 * doubt_s


def _phases(trajectory: Recording, same: float) -> FloatArray:
    """Return the phases (n,) [s] of the samples in the look period, each once."""
    period = look_period(trajectory)
    phase = np.sort(trajectory.time % period)
    apart = np.append(True, np.diff(phase) > same)
    return np.asarray(phase[apart])


def _within_long(trajectory: Recording, instant: FloatArray, same: float) -> np.ndarray:
    """Return which instants (n,) [s] are inside of intervals that are longer than a look interval."""
    row = np.searchsorted(trajectory.time, instant + same, side="right") - 1
    inside = (row >= 0) & (row < trajectory.time.size - 1)
    row = np.clip(row, 0, trajectory.time.size - 2)
    begin, end = trajectory.time[row], trajectory.time[row + 1]
    between = (instant > begin + same) & (instant < end - same)
    return np.asarray(inside & between & (end - begin > look_period(trajectory) + same))
