"""What agents have looked at, on its way into one agent's map: held back where a delay is asked for (6.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.control.report import Report
    from mpc_cover.information.delayed_map import TakesLooks
    from mpc_cover.information.looks import Sensing


class LateLooks:
    """One agent's.

    Parameters
    ----------
    known : the map that the looks go into.
    sensing : which cells are in range of whom.
    delay : samples by which other agents' looks are held back at the least; 0 for none.
    """

    def __init__(self, known: TakesLooks, sensing: Sensing, delay: int) -> None:
        self._known, self._sensing, self._delay = known, sensing, delay
        self._held: dict[int, list[Report]] = {}

    def take(self, agent: int, time_s: float, position: FloatArray | None) -> None:
        """Take in what an agent saw from a (d,) position [m] at a mission time [s]; nothing from nowhere."""
        if position is not None:
            self._known.take(self._sensing.looks(time_s, position[None], np.array([agent])))

    def hear(self, report: Report, own_sample: int) -> None:
        """Take in what another agent reports, at once or when it is due."""
        due = report.sample + self._delay
        if self._delay > 0 and own_sample < due:
            self._held.setdefault(due, []).append(report)
        else:
            self.take(report.agent, report.looked_s, report.looked)

    def catch_up(self, sample: int) -> None:
        """Take in what is due at an own sample."""
        for due in sorted(due for due in self._held if due <= sample):
            for report in self._held.pop(due):
                self.take(report.agent, report.looked_s, report.looked)
