"""The continuous path of a fleet under a zero-order hold: a parabola on each interval (3.1, 4.23)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.arrays import read_only

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray, IntArray


_PIECE = 200_000
"""Intervals times pairs that are processed at once: tens of megabytes, however long the path."""


@dataclass(frozen=True, eq=False)
class Path:
    """A motion sampled at times that need not be evenly spaced.

    Attributes
    ----------
    time : (T,) [s], strictly increasing.
    position, velocity : (T, m, d) [m], [m/s].
    force : (T-1, m, d) inputs [m/s^2], held over each interval.
    """

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    force: FloatArray

    @property
    def step(self) -> FloatArray:
        """(T-1, 1, 1) lengths of the intervals [s], ready to be broadcast."""
        return np.diff(self.time)[:, None, None]

    @property
    def pair(self) -> tuple[IntArray, IntArray]:
        """The (P,) first and (P,) second agent of each pair, P = m (m - 1) / 2."""
        return _pairs(self.position.shape[1])

    def pieces(self) -> Iterator[Path]:
        """Yield the path in pieces, each beginning where the one before ends."""
        intervals, agents = self.force.shape[:2]
        length = max(1, _PIECE // (agents * agents))
        for begin in range(0, intervals, length):
            end = min(begin + length, intervals)
            samples = slice(begin, end + 1)
            yield Path(self.time[samples], self.position[samples], self.velocity[samples], self.force[begin:end])

    def relative(self, pair: tuple[IntArray, IntArray] | None = None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (a, b, c), each (T-1, P, d) [m]: a pair is at a + b s + c s^2 from each other, s in [0, 1].

        `pair` are the (P,) first and (P,) second agents; all pairs where it is left out.
        """
        first, second = self.pair if pair is None else pair
        step = self.step
        a = self.position[:-1, first] - self.position[:-1, second]
        b = (self.velocity[:-1, first] - self.velocity[:-1, second]) * step
        c = (self.force[:, first] - self.force[:, second]) * (0.5 * step**2)
        return a, b, c

    def beside(self, other: Path) -> Path:
        """Return the path of both fleets together: these agents, then those of a path at the same times."""
        ours, theirs = ((path.position, path.velocity, path.force) for path in (self, other))
        return Path(self.time, *(np.concatenate(both, axis=1) for both in zip(ours, theirs, strict=True)))

    def dense(self, points: int) -> tuple[FloatArray, FloatArray]:
        """Return times (Q,) [s] and positions (Q, m, d) [m] at `points` instants of each interval, and the end."""
        part = np.arange(points) / points
        step = self.step[:, None]
        elapsed = part[None, :, None, None] * step
        moved = self.position[:-1, None] + elapsed * self.velocity[:-1, None] + 0.5 * elapsed**2 * self.force[:, None]
        times = (self.time[:-1, None] + part * np.diff(self.time)[:, None]).ravel()
        flat = moved.reshape(-1, *self.position.shape[1:])
        return np.append(times, self.time[-1]), np.concatenate([flat, self.position[-1:]])


@lru_cache(maxsize=8)
def _pairs(agents: int) -> tuple[IntArray, IntArray]:
    first, second = np.triu_indices(agents, k=1)
    return read_only(first), read_only(second)
