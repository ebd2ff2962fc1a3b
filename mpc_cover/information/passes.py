"""What continuous sensors measure between two reports: the cells near the chord of the path."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.motion import chord_deviation
from mpc_cover.model.sensing import TIE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.mission.load import Mission

    Pass = tuple[int, IntArray, float]

_SPEED_ROUNDING = 1e-6
"""Part of a chord by which it may be longer than the speed limit allows; a plain choice for rounding."""


class Passes:
    """The cells that agents passed in range between their reports.

    A path leaves the chord between two reports by at most u_max t^2 / 8, by which radii are shortened: what is
    marked was measured. After a gap in which an agent may have been anywhere nothing between counts.

    Parameters
    ----------
    mission : provides cells, limits and the bound on the noise of positions.
    radius : (m, J) [m], of looks at the reports.
    """

    def __init__(self, mission: Mission, radius: FloatArray) -> None:
        self._cell, self._radius = mission.field.cell, radius
        self._input_max, self._speed_max = mission.fleet.input_max, mission.fleet.speed_max
        self._noise_m = mission.spec.disturbance.position_noise_m
        self._last = np.full(mission.fleet.start.shape, np.nan)
        self._last_s = np.full(mission.fleet.size, -np.inf)

    def advance(self, time_s: float | FloatArray, position: FloatArray, owed: BoolArray) -> Iterator[Pass]:
        """Yield (magnitude, cells, time [s]) of what was passed since the last reports, among `owed` (J, K).

        Agents report (m, d) positions [m] at mission times [s], one for all or (m,); NaN rows report nothing.
        """
        times = np.broadcast_to(np.asarray(time_s, dtype=float), self._last_s.shape)
        for agent in np.flatnonzero(np.isfinite(position).all(axis=1)):
            start, end, passed_s = self._last[agent].copy(), position[agent], float(times[agent] - self._last_s[agent])
            self._last[agent], self._last_s[agent] = end, times[agent]
            if not np.isfinite(passed_s) or passed_s <= 0.0:
                continue
            length, most = float(np.linalg.norm(end - start)), float(self._speed_max[agent]) * passed_s
            if length > most * (1.0 + _SPEED_ROUNDING) + 2.0 * self._noise_m:
                continue
            margin = float(chord_deviation(self._input_max[agent], passed_s))
            for magnitude in np.flatnonzero(self._radius[agent] > margin):
                reach = float(self._radius[agent, magnitude]) - margin + TIE
                some = np.flatnonzero(owed[magnitude] & self._near(0.5 * (start + end), 0.5 * length + reach))
                yield int(magnitude), some[self._chord_distance(some, start, end) <= reach], float(times[agent])

    def _near(self, middle: FloatArray, reach: float) -> BoolArray:
        return np.asarray((np.abs(self._cell - middle) <= reach).all(axis=1))

    def _chord_distance(self, cell: IntArray, start: FloatArray, end: FloatArray) -> FloatArray:
        """Return (n,) [m]: the distances of cells, by index, to a chord from `start` to `end` (d,) [m]."""
        offset, chord = self._cell[cell] - start, end - start
        square = float(chord @ chord)
        part = np.clip(offset @ chord / square, 0.0, 1.0) if square > 0.0 else np.zeros(cell.size)
        return np.asarray(np.linalg.norm(offset - part[:, None] * chord, axis=1))
