"""What a plan is asked for: where something is owed, how much that matters, and how many looks it takes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mpc_cover.arrays import BoolArray, FloatArray, IntArray

_LEAST = 0.25
"""What is owed weighs at least this part of what is owed most: less would be lost in a QP's tolerance."""


@dataclass(frozen=True, eq=False)
class Demand:
    """What is owed.

    Attributes
    ----------
    gamma : (J, K) residual information, 0 where nothing is owed, at most 1.
    looks : (J, K) looks owed, at least 1 where gamma > 0; None for one each.
    """

    gamma: FloatArray
    looks: IntArray | None = None


class FlownMap(Protocol):
    """Residual information as a flight needs it: measured, planned for, told, kept for a successor.

    Attributes
    ----------
    endless : whether it is never complete: a patrol.
    """

    endless: bool

    def observe(self, time_s: float | FloatArray, position: FloatArray) -> None:
        """Take what a fleet at (m, d) positions [m] measures at a mission time [s], or each agent at its own (m,)."""
        ...

    def demand(self, time_s: float, position: FloatArray) -> Demand:
        """Return what a plan that has the fleet at (m, d) positions [m] at `time_s` [s] is to cover."""
        ...

    def begin_lap(self, time_s: float, position: FloatArray) -> None:
        """Choose anew what plans from (m, d) positions [m] at `time_s` [s] on are to cover, if that is by laps."""
        ...

    @property
    def residual(self) -> FloatArray:
        """(J, K) gamma >= 0."""
        ...

    @property
    def owed(self) -> BoolArray:
        """(J, K): where something is owed."""
        ...

    @property
    def covered_at(self) -> FloatArray:
        """(K,) [s]: when nothing was owed any more; inf where something still is."""
        ...

    @property
    def settled(self) -> BoolArray:
        """(K,): where nothing is owed now."""
        ...

    @property
    def cell_count(self) -> int:
        """Number of cells K."""
        ...

    @property
    def covered_count(self) -> int:
        """Number of cells on which nothing is owed now."""
        ...

    @property
    def fraction(self) -> float:
        """Part of the cells on which nothing is owed, 0 to 1; exactly 1 only when nothing is."""
        ...

    @property
    def complete(self) -> bool:
        """Whether the mission is over: nothing is owed, and nothing will be."""
        ...

    def state(self) -> dict[str, FloatArray]:
        """Return all that a successor needs to go on as if nothing had happened."""
        ...

    def restore(self, state: Mapping[str, FloatArray]) -> None:
        """Go on from what `state` returned.

        Raises
        ------
        ValueError
            It is that of another kind of map, or of another mission.
        """
        ...


def scaled(gamma: FloatArray) -> FloatArray:
    """Return gamma as weights of plans: 1 for the largest, and no less than a quarter where anything is owed.

    Variances may have any magnitude; a plan's cost, in cells times metres, should not.
    """
    largest = float(gamma.max(initial=0.0))
    if largest == 0.0:
        return gamma
    return np.where(gamma > 0.0, np.maximum(gamma / largest, _LEAST), 0.0)


def checked(state: Mapping[str, FloatArray], shapes: Mapping[str, tuple[int | None, ...]]) -> dict[str, FloatArray]:
    """Return copies of the arrays of a kept state; None in a shape stands for any length.

    Raises
    ------
    ValueError
        Names or shapes are others.
    """
    if set(state) != set(shapes):
        raise ValueError(f"kept map: holds {sorted(state)}, must hold {sorted(shapes)}")
    for name, shape in shapes.items():
        found = state[name].shape
        if len(found) != len(shape) or any(b not in (None, a) for a, b in zip(found, shape, strict=True)):
            raise ValueError(f"kept map: {name} has shape {found}, must have {shape}")
    return {name: np.array(array, dtype=float) for name, array in state.items()}
