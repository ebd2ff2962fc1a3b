"""The cells in range of agents (5.3), from a subgrid around each agent instead of all distances.

Cells are a product of axes, so the squared distances in a subgrid are sums of one number per axis; only cells within
the radius are looked up. `mpc-cover bench maps` prints the time of a step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.information.looks import Looks
from mpc_cover.mission.field import grid_axes

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.mission.field import Field

_TIE = 1e-9
"""A cell at distance exactly rho is measured, in spite of rounding [m]; as in `model.sensing`."""
_FAR = 1e15
"""Positions beyond this measure nothing, and would overflow an index."""


class Visibility:
    """The visibility sets M of a fleet (5.3, 4.29) on the cells of W.

    Parameters
    ----------
    field : the cells.
    radius : (m, J) [m], -inf where an agent cannot measure a magnitude.

    Raises
    ------
    ValueError
        The cells are not those of a regular grid.
    """

    def __init__(self, field: Field, radius: FloatArray) -> None:
        self._radius = np.asarray(radius, dtype=float)
        self._reach = np.maximum(self._radius, -1.0) + _TIE
        self._farthest = self._reach.max(axis=1, initial=-1.0)
        self._lower, self._size = field.shape_min, field.cell_size
        self._axes = grid_axes(field.shape_min, field.shape_max, field.cell_size)
        place = np.floor((field.cell - self._lower) / self._size + 1e-9).astype(np.intp)
        count = np.array([axis.size for axis in self._axes])
        on_grid = ((place >= 0) & (place < count)).all()
        if not on_grid:
            raise ValueError("field: cells must lie on the grid that starts in its lower corner")
        middle = np.stack([axis[place[:, d]] for d, axis in enumerate(self._axes)], axis=1)
        away = np.linalg.norm(field.cell - middle, axis=1)
        if (away[field.part == 1.0] > 1e-9 * self._size).any():
            raise ValueError("field: the points of whole cells must be those of the grid")
        # border cells may be measured at another point than their middle: looked up farther, and by their distance
        self._away = float(away.max(initial=0.0)) if (away > 1e-9 * self._size).any() else 0.0
        self._cell = field.cell
        self._number = np.full(count, -1, dtype=np.intp)
        self._number[tuple(place.T)] = np.arange(field.size)
        self._full = np.array_equal(self._number.reshape(-1), np.arange(field.size))
        self._shape = (int(self._radius.shape[1]), field.size)

    @property
    def shape(self) -> tuple[int, int]:
        """(J, K): magnitudes and cells."""
        return self._shape

    def looks(self, time_s: float | FloatArray, position: FloatArray, agent: IntArray | None = None) -> Looks:
        """Return what agents (m,) at (m, d) positions [m] measure at a time [s]; NaN rows measure nothing.

        `agent` are indices into the fleet; left out, the rows are the whole fleet. `time_s` may be (fleet,), too.
        """
        index = np.arange(position.shape[0]) if agent is None else agent
        known = (np.abs(position) < _FAR).all(axis=1)
        able = known & (self._farthest[index] > 0.0)
        index = index[able]
        row, cell, square = self._in_reach(position[able], self._farthest[index])
        parts = [self._of_magnitude(j, index[row], cell, square) for j in range(self._shape[0])]
        who, place, near, radius = parts[0] if len(parts) == 1 else map(np.concatenate, zip(*parts, strict=True))
        when = np.full(who.size, time_s) if np.ndim(time_s) == 0 else np.asarray(time_s, dtype=float)[who]
        return Looks(who, place, np.sqrt(near), radius, when)

    def _of_magnitude(self, j: int, who: IntArray, cell: IntArray, square: FloatArray) -> tuple[Any, ...]:
        """Return (agent, place, squared distance, radius) of the looks at magnitude j."""
        if not (self._reach[:, j] == self._farthest).all():
            reach = self._reach[who, j]
            seen = (reach > 0.0) & (square <= reach**2)
            who, cell, square = who[seen], cell[seen], square[seen]
        column = self._radius[:, j]
        alike = bool((column == column[0]).all())
        radius = np.full(who.size, column[0]) if alike else column[who]
        return who, cell + j * self._shape[1] if j else cell, square, radius

    def _in_reach(self, position: FloatArray, reach: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Return (row, cell, squared distance [m^2]), each (n,), of the cells within (m,) `reach` [m]."""
        agents, dimension = position.shape
        measured, reach = reach, reach + self._away
        if agents == 0:
            return np.empty(0, np.intp), np.empty(0, np.intp), np.empty(0)
        lowest = np.clip((position - reach[:, None] - self._lower) / self._size - 1.0, -1e9, 1e9)
        first = np.floor(lowest).astype(np.intp)  # one cell more: the last row may be pulled in
        width = int(min(np.ceil(2.0 * reach.max() / self._size) + 3, max(self._number.shape)))
        square: Any = 0.0
        grid: Any = 0
        for d, axis in enumerate(self._axes):
            along = np.clip(first[:, d], 0, max(axis.size - width, 0))[:, None] + np.arange(min(width, axis.size))
            spread = [agents, *[1] * dimension]
            spread[1 + d] = along.shape[1]
            square = square + ((axis[along] - position[:, d, None]) ** 2).reshape(spread)
            grid = grid * axis.size + along.reshape(spread)
        close = square <= (reach**2).reshape(agents, *[1] * dimension)
        row = np.repeat(np.arange(agents), np.count_nonzero(close.reshape(agents, -1), axis=1))
        inside = np.flatnonzero(close)
        cell, near = np.take(grid, inside), np.take(square, inside)
        if not self._full:
            cell = self._number.reshape(-1)[cell]
            real = cell >= 0  # the grid has places outside W
            row, cell, near = row[real], cell[real], near[real]
        if self._away == 0.0:
            return row, cell, near
        near = ((self._cell[cell] - position[row]) ** 2).sum(axis=1)
        seen = near <= measured[row] ** 2
        return row[seen], cell[seen], near[seen]
