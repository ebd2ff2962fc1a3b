"""Stochastic coverage: a Kalman filter for each cell of a static field (5.6 to 5.8), in information form."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.information.looks import accumulate
from mpc_cover.information.residual_map import ResidualMap

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.information.looks import Looks, Sensing

_ROUNDING = 1e-12
"""Part of P_max that rounding may leave P above it by."""


class KalmanMap(ResidualMap):
    """gamma = pos(P - P_max), with the estimate of the field.

    With Y = 1/P and y = x/P, looks of any number of sensors are sums: Y grows by 1/R, y by z/R. That equals
    the thesis's gain form K = P H' (H P H' + R)^-1 with all sensors of a step at once.

    Parameters
    ----------
    sensing : readings come with its looks; without them the variance is kept and the estimate stays.
    variance : P(0) of each cell, in the field's unit squared.
    noise : (m,) R of each agent's sensor, in the field's unit squared; one number for all.
    enough : P_max.
    mean : estimate before the first reading.

    Attributes
    ----------
    information : (J, K) Y = 1/P.
    state : (J, K) y = x/P.

    Raises
    ------
    ValueError
        A variance that is not positive and finite.
    """

    def __init__(
        self, sensing: Sensing, *, variance: float, noise: float | FloatArray, enough: float, mean: float = 0.0
    ) -> None:
        for name, value in (("variance", variance), ("noise", noise), ("enough", enough)):
            number = np.asarray(value, dtype=float)
            if not ((number > 0.0) & (number < np.inf)).all():
                raise ValueError(f"Kalman map: {name} {value}: must be positive and finite")
        super().__init__(sensing)
        self._weight = 1.0 / np.atleast_1d(np.asarray(noise, dtype=float))
        self.enough = enough
        self.information: FloatArray = np.full(sensing.shape, 1.0 / variance)
        self.state: FloatArray = np.full(sensing.shape, mean / variance)
        if (1.0 / self.information <= enough * (1.0 + _ROUNDING)).all():
            self.done_at[:] = 0.0

    @property
    def variance(self) -> FloatArray:
        """(J, K) P."""
        return np.asarray(1.0 / self.information)

    @property
    def estimate(self) -> FloatArray:
        """(J, K) x, in the field's unit."""
        return np.asarray(self.state / self.information)

    @property
    def kept(self) -> dict[str, FloatArray]:
        """The arrays of what was measured; writing to them changes the map."""
        return {**super().kept, "information": self.information, "state": self.state}

    def gamma_at(self, place: IntArray | slice) -> FloatArray:
        """Return pos(P - P_max) at places of the flattened (J, K) array."""
        left = 1.0 / self.information.reshape(-1)[place] - self.enough
        return np.where(left > _ROUNDING * self.enough, left, 0.0)

    @property
    def looks_owed(self) -> IntArray:
        """(J, K): the least number of further looks, each by the best sensor: 1/P_max - 1/P over 1/R."""
        missing = (1.0 / self.enough - self.information) / self._weight.max()
        return np.where(self.residual > 0.0, np.maximum(np.ceil(missing - 1e-9), 1.0), 0.0).astype(np.intp)

    def _fuse(self, looks: Looks) -> None:
        weight = self._weight[looks.agent] if self._weight.size > 1 else float(self._weight[0])
        information, state = self.information.reshape(-1), self.state.reshape(-1)
        # without a reading the estimate stays: as if the sensor had read just what is expected
        expected = state[looks.place] / information[looks.place] if looks.value is None else looks.value
        accumulate(information, looks.place, weight)
        accumulate(state, looks.place, weight * expected)
