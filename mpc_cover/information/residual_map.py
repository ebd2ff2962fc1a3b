"""The interface and base class of residual information maps: gamma, what is owed, what is covered (5.2.1)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.information.looks import Looks, Sensing


class InformationMap(Protocol):
    """Residual information of (magnitude, cell), whatever "measured" means."""

    def observe(self, time_s: float, position: FloatArray) -> None:
        """Take in what a fleet at (m, d) positions [m] measures at a mission time [s]; NaN rows measure nothing."""
        ...

    @property
    def residual(self) -> FloatArray:
        """(J, K) gamma >= 0, zero where nothing is owed."""
        ...

    @property
    def owed(self) -> BoolArray:
        """(J, K): where gamma > 0."""
        ...

    @property
    def complete(self) -> bool:
        """Whether nothing is owed."""
        ...

    @property
    def fraction(self) -> float:
        """Part of the cells on which nothing is owed, 0 to 1; exactly 1 only when complete."""
        ...


class ResidualMap(ABC):
    """A gamma by the assumptions of 5.2.1, with the erratum: positive, not increasing, zero in finite looks.

    Looks may be taken in any order and in any grouping: gamma depends only on which were taken. Therefore delayed
    maps over-estimate (5.2.1.1).

    Attributes
    ----------
    done_at : (J, K) [s], the time of the look that settled each magnitude and cell; inf where owed.
    """

    def __init__(self, sensing: Sensing) -> None:
        self._sensing = sensing
        self.done_at: FloatArray = np.full(sensing.shape, np.inf)

    @abstractmethod
    def gamma_at(self, place: IntArray | slice) -> FloatArray:
        """Return gamma >= 0 at places of the flattened (J, K) array."""

    @abstractmethod
    def _fuse(self, looks: Looks) -> None:
        """Add looks to what is known."""

    @property
    @abstractmethod
    def looks_owed(self) -> IntArray:
        """(J, K): the least number of further looks that settles each place."""

    @property
    def looks_expected(self) -> IntArray:
        """(J, K): how many further looks will probably settle each place; what plans ask for."""
        return self.looks_owed

    @property
    def kept(self) -> dict[str, FloatArray]:
        """The arrays of what was measured; writing to them changes the map."""
        return {"done_at": self.done_at}

    def observe(self, time_s: float, position: FloatArray) -> None:
        """Take in what a fleet at (m, d) positions [m] measures at a mission time [s]; NaN rows measure nothing."""
        self.take(self._sensing.looks(time_s, position))

    def take(self, looks: Looks) -> None:
        """Take in looks, each once, in any order."""
        if looks.count == 0:
            return
        self._fuse(looks)
        settled = self.done_at.reshape(-1)
        owed = np.flatnonzero(settled[looks.place] == np.inf)
        place = looks.place[owed]
        now = np.flatnonzero(self.gamma_at(place) == 0.0)
        place = place[now]
        settled[place] = 0.0
        np.maximum.at(settled, place, looks.time_s[owed[now]])

    @property
    def residual(self) -> FloatArray:
        """(J, K) gamma >= 0."""
        return self.gamma_at(slice(None)).reshape(self._sensing.shape)

    @property
    def owed(self) -> BoolArray:
        """(J, K): where gamma > 0."""
        return np.isinf(self.done_at)

    @property
    def covered_at(self) -> FloatArray:
        """(K,) [s]: when the last magnitude was settled on each cell; inf where never."""
        return np.asarray(self.done_at.max(axis=0))

    @property
    def covered_count(self) -> int:
        """Number of cells on which nothing is owed."""
        return int((~self.owed).all(axis=0).sum())

    @property
    def fraction(self) -> float:
        """Part of the cells on which nothing is owed, 0 to 1; exactly 1 only when complete."""
        return self.covered_count / self._sensing.shape[1]

    @property
    def complete(self) -> bool:
        """Whether nothing is owed; gamma is zero everywhere."""
        return not bool(self.owed.any())
