"""Globalisation of a local iteration: a trust region and a backtracking line search."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

T = TypeVar("T")

_ACTIVE_SHARE = 0.5
"""Part of the radius from which on the trust region counts as active, and may grow; a plain choice."""


@dataclass(frozen=True)
class TrustRegion:
    """The radius within which the model is trusted, and its updates (Nocedal & Wright, algorithm 4.1).

    Attributes
    ----------
    radius: in the units of x, infinity norm.
    smallest, largest: bounds on the radius; at or below `smallest` it is exhausted.
    shrink, grow: factors, shrink < 1 < grow.
    poor, good: ratios of actual to predicted decrease that shrink and grow the radius.
    """

    radius: float
    smallest: float = 1e-10
    largest: float = 1e3
    shrink: float = 0.25
    grow: float = 2.0
    poor: float = 0.25
    good: float = 0.75

    def __post_init__(self) -> None:
        """Raise `ValueError` for inconsistent parameters."""
        if not 0.0 < self.smallest < self.largest:
            raise ValueError(f"0 < smallest < largest is wanted, got {self.smallest}, {self.largest}")
        if not 0.0 < self.radius <= self.largest:
            raise ValueError(f"the radius must be in (0, {self.largest}], got {self.radius}")
        if not 0.0 < self.shrink < 1.0 < self.grow:
            raise ValueError(f"shrink < 1 < grow is wanted, got {self.shrink}, {self.grow}")
        if not 0.0 <= self.poor < self.good:
            raise ValueError(f"0 <= poor < good is wanted, got {self.poor}, {self.good}")

    @property
    def exhausted(self) -> bool:
        """Whether the radius is too small to continue."""
        return self.radius <= self.smallest

    def accepted(self, ratio: float, step: float) -> TrustRegion:
        """Return the region after an accepted step of length `step` with this ratio of decreases."""
        if ratio < self.poor:
            return self.resized(self.shrink * self.radius)
        if ratio > self.good and step >= _ACTIVE_SHARE * self.radius:
            return self.resized(self.grow * self.radius)
        return self

    def rejected(self, step: float) -> TrustRegion:
        """Return the region after a rejected step of length `step`: smaller than that step."""
        return self.resized(self.shrink * min(self.radius, max(step, self.smallest)))

    def resized(self, radius: float) -> TrustRegion:
        """Return the region with this radius, within its bounds."""
        return replace(self, radius=min(max(radius, self.smallest), self.largest))


@dataclass(frozen=True)
class Backtracking:
    """Step-length reduction until the merit decreases sufficiently (Armijo; Nocedal & Wright, algorithm 3.1).

    Attributes
    ----------
    most: number of trials; 0 switches the search off.
    factor: of the step length from one trial to the next, in (0, 1).
    sufficient: share of the predicted decrease that is required.
    """

    most: int = 4
    factor: float = 0.5
    sufficient: float = 1e-4

    def __post_init__(self) -> None:
        """Raise `ValueError` for inconsistent parameters."""
        if self.most < 0 or not 0.0 < self.factor < 1.0 or not 0.0 < self.sufficient < 1.0:
            raise ValueError(f"most >= 0 and factor, sufficient in (0, 1) are wanted, got {self}")

    def search(
        self, trial: Callable[[float], T], decrease: Callable[[T], float], predicted: float
    ) -> tuple[float, T] | None:
        """Return the first step length below 1, and its trial, with a sufficient decrease of the merit, or None.

        Parameters
        ----------
        trial: step length -> a candidate. decrease: candidate -> the decrease of its merit.
        predicted: the model's decrease for the full step; by convexity at least its share for less.
        """
        length = 1.0
        for _ in range(self.most):
            length *= self.factor
            candidate = trial(length)
            if decrease(candidate) >= self.sufficient * length * predicted:
                return length, candidate
        return None
