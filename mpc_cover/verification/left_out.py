"""Looks that a thinned record left out: what a sensor saw at their instants follows from the path between samples.

Sensors look once a look interval. A record whose samples are farther apart has left some out, whose instants are
those of its samples moved by look intervals.
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
_LONGER = 1.0 + 1e-6
"""Intervals longer than this many look intervals have left out a look, if any; 1 but for rounding."""
_MOST = 200_000
"""Instants put in at most: seconds of work. A plain choice; with fewer, honest claims may fail, none passes."""


def look_period(trajectory: Recording) -> float:
    """Return the time between looks [s]: T_s of plans, the state period of flights."""
    control = trajectory.mission.spec.control
    planned = trajectory.meta.get("kind") == RecordingKind.PLAN
    return control.period_s if planned else control.state_period_s


def with_claimed_looks(trajectory: Recording) -> Recording:
    """Return the recording with samples at the instants of left-out looks by which cells are claimed to be covered."""
    claimed = np.unique(trajectory.covered_at[np.isfinite(trajectory.covered_at)])
    period, phase = look_period(trajectory), _phases(trajectory)
    inside = claimed[_within_long(trajectory, claimed)]
    around = np.concatenate([[phase[-1] - period], phase, [phase[0] + period]])
    after = np.clip(np.searchsorted(around, inside % period), 1, around.size - 1)
    away = np.minimum(np.abs(around[after] - inside % period), np.abs(around[after - 1] - inside % period))
    return with_samples(trajectory, inside[away <= _SAME_TIME * period])


def with_left_out_looks(trajectory: Recording) -> Recording:
    """Return the recording with samples at the instants of all looks that were left out."""
    period, phase = look_period(trajectory), _phases(trajectory)
    long = np.flatnonzero(np.diff(trajectory.time) > _LONGER * period)
    count = np.diff(trajectory.time)[long].sum() / period * phase.size
    if not long.size or count > _MOST:
        return trajectory
    pieces = []
    for begin, end in zip(trajectory.time[long], trajectory.time[long + 1], strict=True):
        first = np.ceil((begin - phase) / period)[:, None] + np.arange(np.ceil((end - begin) / period) + 1.0)
        pieces.append((phase[:, None] + period * first).ravel())
    instant = np.unique(np.concatenate(pieces))
    return with_samples(trajectory, instant[_within_long(trajectory, instant)])


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


def _phases(trajectory: Recording) -> FloatArray:
    """Return the phases (n,) [s] of the samples in the look period, each once."""
    period = look_period(trajectory)
    phase = np.sort(trajectory.time % period)
    apart = np.append(True, np.diff(phase) > _SAME_TIME * period)
    return np.asarray(phase[apart])


def _within_long(trajectory: Recording, instant: FloatArray) -> np.ndarray:
    """Return which instants (n,) [s] are inside of intervals that are longer than a look interval."""
    same = _SAME_TIME * look_period(trajectory)
    row = np.searchsorted(trajectory.time, instant + same, side="right") - 1
    inside = (row >= 0) & (row < trajectory.time.size - 1)
    row = np.clip(row, 0, trajectory.time.size - 2)
    begin, end = trajectory.time[row], trajectory.time[row + 1]
    between = (instant > begin + same) & (instant < end - same)
    return np.asarray(inside & between & (end - begin > _LONGER * look_period(trajectory)))
