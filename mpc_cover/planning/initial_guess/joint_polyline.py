"""Flight of a fleet along a polyline of joint positions: all agents are the same part of their legs at any time.

Corners are blended: the velocities of two legs turn into each other at a constant rate, so that the motion is exact
under a zero-order hold and all agents arrive at each leg together. Whatever is the same for all agents at both ends of
a leg, their distances above all, stays the same along it.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.tolerances import STEP_ROUNDING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import FloatArray, IntArray

_NO_LEG = 1e-6
"""Legs shorter than this part of the way of a step are left out; a plain choice."""


def fly_polyline(
    corner: FloatArray, speed: FloatArray, force: FloatArray, period: float, stops: Sequence[int] = ()
) -> FloatArray:
    """Return velocities (N+1, m, d) [m/s] along corners (W, m, d) [m], from rest to rest, within the limits.

    Corners with the indices `stops` are reached exactly, at rest; others are blended.

    `speed`, `force` (m,) [m/s], [m/s^2] are those of each agent: the one to whom a leg takes longest sets the pace of
    all. Each leg takes a whole number of samples: so many at its own velocity, and half of each blend.
    """
    cuts = [0, *sorted({stop for stop in stops if 0 < stop < len(corner) - 1}), len(corner) - 1]
    parts = [_blended(corner[a : b + 1], speed, force, period) for a, b in pairwise(cuts)]
    return np.concatenate([parts[0], *(part[1:] for part in parts[1:])])


def _blended(corner: FloatArray, speed: FloatArray, force: FloatArray, period: float) -> FloatArray:
    """Return velocities (N+1, m, d) [m/s] along corners (W, m, d) [m], all of them blended."""
    way = np.diff(corner, axis=0)
    takes = (np.linalg.norm(way, axis=2) / speed).max(axis=1, initial=0.0) / period  # in samples
    way, takes = way[takes > _NO_LEG], takes[takes > _NO_LEG]
    blend = np.ones(len(way) + 1, dtype=np.intp)
    while True:
        halves = 0.5 * (blend[:-1] + blend[1:])
        cruise = np.maximum(np.ceil(takes - halves - STEP_ROUNDING), 0.0).astype(np.intp)
        velocity = way / (period * (cruise + halves))[:, None, None]
        still = np.zeros((1, *way.shape[1:]))
        change = np.diff(np.concatenate([still, velocity, still]), axis=0)
        need = np.ceil((np.linalg.norm(change, axis=2) / (force * period)).max(axis=1, initial=0.0) - STEP_ROUNDING)
        if (need <= blend).all():
            return _samples(velocity, cruise, blend)
        blend = np.maximum(blend, need.astype(np.intp))


def _samples(velocity: FloatArray, cruise: IntArray, blend: IntArray) -> FloatArray:
    """Return the velocities (N+1, m, d) at samples of legs with (L, m, d) velocities, `cruise` and `blend` samples."""
    still = np.zeros_like(velocity[:1]) if len(velocity) else np.zeros((1, *velocity.shape[1:]))
    before, after = np.concatenate([still, velocity]), np.concatenate([velocity, still])
    parts = [still]
    for number, steps in enumerate(blend):
        share = (np.arange(1, steps + 1) / steps)[:, None, None]
        parts.append(before[number] + share * (after[number] - before[number]))
        if number < len(cruise):
            parts.append(np.repeat(after[number][None], cruise[number], axis=0))
    return np.concatenate(parts)


def cut_short(velocity: FloatArray, steps: int, force: FloatArray, period: float) -> FloatArray:
    """Return (steps+1, m, d) velocities [m/s] that follow those given (N+1, m, d), and brake together in time.

    They rest at the end where the motion is shorter. While braking, all go straight on, within `force` (m,) [m/s^2].
    """
    rest = max(steps + 1 - velocity.shape[0], 0)
    velocity = np.concatenate([velocity, np.zeros((rest, *velocity.shape[1:]))])
    brake = np.ceil((np.linalg.norm(velocity, axis=2) / (force * period)).max(axis=1) - STEP_ROUNDING).astype(np.intp)
    last = int(np.flatnonzero(np.arange(steps + 1) + brake[: steps + 1] <= steps)[-1])
    share = np.linspace(1.0, 0.0, int(brake[last]) + 1) if brake[last] else np.ones(1)
    stop = velocity[last] * share[:, None, None]
    after = np.zeros((steps - last - int(brake[last]), *velocity.shape[1:]))
    return np.concatenate([velocity[:last], stop, after])
