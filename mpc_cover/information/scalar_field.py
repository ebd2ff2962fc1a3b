"""A static scalar field to be estimated, and sensors that read it with noise (5.6, 5.7)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.information.looks import Looks, Sensing


def bumpy_field(cell: FloatArray, rng: np.random.Generator, bumps: int = 5, amplitude: float = 3.0) -> FloatArray:
    """Return (K,) values of a smooth field at (K, d) centroids [m]: a sum of random Gaussian bumps, up and down.

    The bumps lie within the cells' bounding box, a tenth to a fourth of its size wide.
    """
    lower, upper = cell.min(axis=0), cell.max(axis=0)
    size = max(float((upper - lower).max()), 1e-9)
    centre = rng.uniform(lower, upper, (bumps, cell.shape[1]))
    width = rng.uniform(0.1, 0.25, bumps) * size
    height = amplitude * rng.uniform(0.5, 1.0, bumps) * np.where(np.arange(bumps) % 3 == 2, -1.0, 1.0)  # noqa: PLR2004
    square = ((cell[:, None] - centre) ** 2).sum(axis=2)
    return np.asarray((height * np.exp(-0.5 * square / width**2)).sum(axis=1))


@dataclass(frozen=True, eq=False)
class NoisySensing:
    """Sensing whose looks carry readings z = x + v, v Gaussian with variance R (5.7).

    Attributes
    ----------
    sensing : which cells are in range.
    truth : (J, K) the field x.
    noise : (m,) R of each agent's sensor, or one number for all, in the field's unit squared.
    rng : random generator of the noise.
    """

    sensing: Sensing
    truth: FloatArray
    noise: float | FloatArray
    rng: np.random.Generator

    @property
    def shape(self) -> tuple[int, int]:
        """(J, K): magnitudes and cells."""
        return self.sensing.shape

    def looks(self, time_s: float | FloatArray, position: FloatArray, agent: IntArray | None = None) -> Looks:
        """Return the looks of agents (m,) at (m, d) positions [m] at a time [s], with readings."""
        bare = self.sensing.looks(time_s, position, agent)
        spread = np.sqrt(np.atleast_1d(np.asarray(self.noise, dtype=float)))
        each = spread[bare.agent] if spread.size > 1 else spread
        noise = each * self.rng.standard_normal(bare.count)
        return bare.with_value(self.truth.reshape(-1)[bare.place] + noise)


@dataclass(frozen=True, eq=False)
class TimedReadings:
    """Readings z = x + v whose noise depends only on agent and time: all that compute a reading get the same.

    They are quantised to about a hundredth of the noise, as instruments' are: few digits represent them exactly.

    Attributes
    ----------
    sensing : which cells are in range.
    truth : (J, K) the field x.
    variance : R of all sensors, in the field's unit squared.
    seed : of the noise.
    """

    sensing: Sensing
    truth: FloatArray
    variance: float
    seed: int

    @property
    def shape(self) -> tuple[int, int]:
        """(J, K): magnitudes and cells."""
        return self.sensing.shape

    def looks(self, time_s: float | FloatArray, position: FloatArray, agent: IntArray | None = None) -> Looks:
        """Return the looks of agents (m,) at (m, d) positions [m] at a time [s], with readings."""
        bare = self.sensing.looks(time_s, position, agent)
        if bare.count == 0:
            return bare
        spread = float(np.sqrt(self.variance))
        read = self.truth.reshape(-1)[bare.place]
        for one in np.unique(bare.agent).tolist():
            mine = np.flatnonzero(bare.agent == one)
            microseconds = round(max(0.0, float(bare.time_s[mine[0]])) * 1e6)
            rng = np.random.default_rng([self.seed, microseconds, one])
            read[mine] += spread * rng.standard_normal(mine.size)
        return bare.with_value(np.round(read, 2 - int(np.floor(np.log10(spread)))))
