"""Blocks of cells that plans cover as one, where cells are far smaller than a sensing radius.

The QP of a plan has a row for each cell near the edge of coverage: with 200,000 cells it takes seconds, and the
back-ends were not made for it. What matters to a plan are distances on the scale of the sensing radius. So the cells of
a block are planned for as one point, with a sensing radius that is smaller by the distance of the farthest of them: who
covers the point covers them all. The map, the recordings and the verifier keep the cells.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from mpc_cover.mission.load import Mission

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.mission.field import Field

Number = TypeVar("Number", np.float64, np.intp)

_BLOCK_SHARE = 0.2
"""Edge of a block in sensing radii, at most; a plain choice: the radius that plans lose is a tenth."""
_FEW = 2000
"""Up to so many cells there are no blocks; a plain choice, at which a QP takes some hundredths of a second."""


@dataclass(frozen=True, eq=False)
class CellBlocks:
    """A mission's cells in blocks.

    Attributes
    ----------
    order : (K,) the cells, block by block.
    first : (B,) where each block begins in `order`.
    cell : (B, d) mean of a block's cells [m].
    reach : distance of a cell from the mean of its block, at most [m].
    edge : of a block [m].
    """

    order: IntArray
    first: IntArray
    cell: FloatArray
    reach: float
    edge: float

    @classmethod
    def of(cls, mission: Mission) -> CellBlocks | None:
        """Return the blocks of a mission's cells; None where they are few, or no smaller than a block should be."""
        field = mission.field
        across = int(_BLOCK_SHARE * mission.fleet.sensing_radius_min / field.cell_size + 1e-9)
        if across < 2 or field.size <= _FEW:  # noqa: PLR2004 - a block of one cell
            return None
        edge = across * field.cell_size
        place = np.floor((field.cell - field.shape_min) / edge + 1e-9).astype(np.intp)
        number = np.ravel_multi_index(tuple(place.T), tuple(place.max(axis=0) + 1))
        order = np.argsort(number, kind="stable")
        first = np.flatnonzero(np.diff(number[order], prepend=-1))
        count = np.diff([*first, field.size])
        mean = np.add.reduceat(field.cell[order], first) / count[:, None]
        away = np.linalg.norm(field.cell[order] - np.repeat(mean, count, axis=0), axis=1)
        return cls(order, first, mean, float(away.max()), edge)

    def mission(self, mission: Mission) -> Mission:
        """Return the mission with a cell for each block, and sensing radii with which covering it covers the block."""
        fleet = replace(mission.fleet, radius=mission.fleet.radius - self.reach)
        return Mission(mission.spec, self._field(mission.field), fleet)

    def most(self, values: NDArray[Number]) -> NDArray[Number]:
        """Return (J, B): the largest of the (J, K) values of the cells of each block."""
        return np.asarray(np.maximum.reduceat(values[:, self.order], self.first, axis=1))

    def any(self, values: BoolArray) -> BoolArray:
        """Return (J, B): whether any of the (J, K) values of the cells of each block holds."""
        return np.asarray(np.logical_or.reduceat(values[:, self.order], self.first, axis=1))

    def _field(self, field: Field) -> Field:
        count = np.diff([*self.first, field.size])
        weight = np.add.reduceat(field.weight[self.order], self.first) / count
        whole = (self.edge / field.cell_size) ** field.cell.shape[1]
        part = np.add.reduceat(field.part[self.order], self.first) / whole
        return replace(field, cell=self.cell, cell_size=self.edge, weight=weight, part=part)
