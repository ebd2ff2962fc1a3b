"""The demand on plans: where information is owed, with what weight, and how many looks it takes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.model.cell_blocks import CellBlocks

_LEAST = 0.25
"""Smallest weight relative to the largest: smaller ones would be lost in a QP's tolerance."""


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

    def of_blocks(self, blocks: CellBlocks) -> Demand:
        """Return the demand of blocks of cells: of each the largest of its cells."""
        return Demand(blocks.most(self.gamma), None if self.looks is None else blocks.most(self.looks))


class DemandMap(Protocol):
    """What is owed, as control laws see it."""

    @property
    def endless(self) -> bool:
        """Whether it is never complete: a patrol."""
        ...

    def demand(self, time_s: float, position: FloatArray) -> Demand:
        """Return what a plan from (m, d) positions [m] at `time_s` [s] on is to cover."""
        ...

    def begin_lap(self, time_s: float, position: FloatArray) -> None:
        """Begin a lap of plans from (m, d) positions [m] at `time_s` [s] on, if the map has laps."""
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
    def complete(self) -> bool:
        """Whether the mission is over: nothing is owed, and nothing will be."""
        ...


class FlownMap(DemandMap, Protocol):
    """A map of residual information in flight: updated, planned for, reported, and kept for a later controller."""

    def observe(self, time_s: float | FloatArray, position: FloatArray) -> None:
        """Take in what a fleet at (m, d) positions [m] measures at a mission time [s], one for all or (m,)."""
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

    def state(self) -> dict[str, FloatArray]:
        """Return the state from which a later controller resumes exactly."""
        ...

    def restore(self, state: Mapping[str, FloatArray]) -> None:
        """Resume from what `state` returned.

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
