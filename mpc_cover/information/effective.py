"""Effective coverage with any instantaneous coverage function; K-coverage is a special case (5.2.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from mpc_cover.information.looks import accumulate
from mpc_cover.information.residual_map import ResidualMap

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.information.looks import Looks, Sensing

_ROUNDING = 1e-12
"""Part of C* that sums of looks may fall short by, as ten times 0.1 does."""


class InstantCoverage(Protocol):
    """A_i(q_i, p_k): the amount that each look adds; positive in range, zero elsewhere (where there is no look)."""

    peak: float
    usual: float
    """The average amount of a look, from anywhere in the disc."""

    def __call__(self, looks: Looks) -> FloatArray:
        """Return (n,) amounts, each > 0 and at most `peak`."""
        ...


class EachLook:
    """A = 1 in range: looks are counted (K-coverage)."""

    peak = usual = 1.0

    def __call__(self, looks: Looks) -> FloatArray:
        """Return (n,) ones."""
        return np.ones(looks.count)


class Bump:
    """A falls smoothly from `peak` at the agent to `rim` at its radius, as Hussein and Stipanovic's does.

    A = rim + (peak - rim) (1 - d^2 / rho^2)^2. Theirs has rim = 0, but 5.2.1 asks for A > 0 in the whole of M.

    Raises
    ------
    ValueError
        Not 0 < rim <= peak < inf.
    """

    def __init__(self, peak: float, rim: float) -> None:
        if not 0.0 < rim <= peak < np.inf:
            raise ValueError(f"instant coverage: rim {rim} and peak {peak}: must be 0 < rim <= peak < inf")
        self.peak = peak
        self.usual = rim + (peak - rim) / 3.0  # the mean of (1 - s)^2 over the part s of a disc's area
        self._rim = rim

    def __call__(self, looks: Looks) -> FloatArray:
        """Return (n,) amounts."""
        inside = np.maximum(1.0 - (looks.distance / looks.radius) ** 2, 0.0)
        return np.asarray(self._rim + (self.peak - self._rim) * inside**2)


class EffectiveCoverage(ResidualMap):
    """gamma = pos(C* - sum of A over all looks).

    Attributes
    ----------
    effective : (J, K) coverage so far, the sum of A.
    level : C*.

    Raises
    ------
    ValueError
        C* is not positive and finite; a look adds nothing, or more than the function's peak.
    """

    def __init__(self, sensing: Sensing, level: float, instant: InstantCoverage) -> None:
        if not 0.0 < level < np.inf:
            raise ValueError(f"effective coverage: level {level}: must be positive and finite")
        super().__init__(sensing)
        self.level = level
        self.effective: FloatArray = np.zeros(sensing.shape)
        self._instant = instant

    def gamma_at(self, place: IntArray | slice) -> FloatArray:
        """Return pos(C* - J) at places of the flattened (J, K) array."""
        left = self.level - self.effective.reshape(-1)[place]
        return np.where(left > _ROUNDING * self.level, left, 0.0)

    @property
    def looks_owed(self) -> IntArray:
        """(J, K): the least number of further looks, each from where A is largest."""
        return np.ceil(self.residual / self._instant.peak - 1e-9).astype(np.intp)

    @property
    def looks_expected(self) -> IntArray:
        """(J, K): how many further looks will probably settle each place, each from anywhere in the disc."""
        return np.ceil(self.residual / self._instant.usual - 1e-9).astype(np.intp)

    @property
    def kept(self) -> dict[str, FloatArray]:
        """The arrays of what was measured; writing to them changes the map."""
        return {**super().kept, "effective": self.effective}

    def _fuse(self, looks: Looks) -> None:
        amount = self._instant(looks)
        if not (amount.min(initial=np.inf) > 0.0 and amount.max(initial=0.0) <= self._instant.peak):
            raise ValueError("instant coverage: must be > 0 in range, and at most its peak")
        accumulate(self.effective.reshape(-1), looks.place, amount)


def k_coverage(sensing: Sensing, looks: int) -> EffectiveCoverage:
    """Return the map that asks for `looks` looks at every cell and magnitude; plain coverage with one.

    Raises
    ------
    ValueError
        Less than one look.
    """
    if looks < 1:
        raise ValueError(f"K-coverage: looks {looks}: must be at least 1")
    return EffectiveCoverage(sensing, float(looks), EachLook())
