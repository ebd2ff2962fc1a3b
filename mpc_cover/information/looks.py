"""Measurements as flat arrays: agent, cell, time, distance and reading of each look (5.3, 5.7)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Looks:
    """n looks, one for each agent, magnitude and cell in range (H = 1 in 5.7).

    Attributes
    ----------
    agent : (n,) index of the agent in the fleet.
    place : (n,) index of (magnitude, cell) in a flattened (J, K) array.
    distance : (n,) [m] from the agent to the cell's centroid.
    radius : (n,) [m] within which the agent measures the magnitude.
    time_s : (n,) [s] of the mission.
    value : (n,) readings, in the field's unit; None for maps that use none.
    """

    agent: IntArray
    place: IntArray
    distance: FloatArray
    radius: FloatArray
    time_s: FloatArray
    value: FloatArray | None = None

    @property
    def count(self) -> int:
        """Number of looks n."""
        return int(self.agent.size)

    def where(self, mask: BoolArray) -> Looks:
        """Return the looks for which the (n,) mask holds."""
        value = None if self.value is None else self.value[mask]
        return Looks(
            self.agent[mask], self.place[mask], self.distance[mask], self.radius[mask], self.time_s[mask], value
        )

    def with_value(self, value: FloatArray) -> Looks:
        """Return the same looks with (n,) readings."""
        return replace(self, value=value)


_DENSE = 8
"""With more looks than one in so many places, one pass over all places is faster."""


def accumulate(total: FloatArray, place: IntArray, amount: float | FloatArray) -> None:
    """Add to a flat (J K,) array at each of (n,) places, as often as they occur, `amount`: one for all, or (n,)."""
    if place.size * _DENSE < total.size:
        np.add.at(total, place, amount)
    elif isinstance(amount, float):
        total += amount * np.bincount(place, minlength=total.size)
    else:
        total += np.bincount(place, weights=amount, minlength=total.size)


def joined(parts: Sequence[Looks]) -> Looks:
    """Return all looks of several, one part at the least; readings only where every part has them."""
    if len(parts) == 1:
        return parts[0]
    values = [part.value for part in parts if part.value is not None]
    return Looks(
        np.concatenate([part.agent for part in parts]),
        np.concatenate([part.place for part in parts]),
        np.concatenate([part.distance for part in parts]),
        np.concatenate([part.radius for part in parts]),
        np.concatenate([part.time_s for part in parts]),
        np.concatenate(values) if len(values) == len(parts) else None,
    )


class Sensing(Protocol):
    """Turns positions into looks: the cells in range, with readings or without."""

    @property
    def shape(self) -> tuple[int, int]:
        """(J, K): magnitudes and cells."""
        ...

    def looks(self, time_s: float | FloatArray, position: FloatArray, agent: IntArray | None = None) -> Looks:
        """Return what agents (m,) at (m, d) positions [m] measure at a mission time [s], or each at its own."""
        ...
