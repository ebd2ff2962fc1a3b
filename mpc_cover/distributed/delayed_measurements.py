"""Measurements on their way into one agent's map: held back where the mission asks for a delay (6.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.distributed.state_report import StateReport
    from mpc_cover.information.delayed_map import TakesLooks
    from mpc_cover.information.looks import Sensing


class DelayedMeasurements:
    """The measurements that one agent takes in.

    Parameters
    ----------
    known : the map that the looks go into.
    sensing : which cells are in range of each agent.
    reads : whether the map asks for readings: looks that come without are not counted.
    delay : samples by which other agents' looks are held back at the least; 0 for none.
    """

    def __init__(self, known: TakesLooks, sensing: Sensing, delay: int, *, reads: bool = False) -> None:
        self._known, self._sensing, self._delay, self._reads = known, sensing, delay, reads
        self._held: dict[int, list[StateReport]] = {}

    def take(self, report: StateReport) -> None:
        """Take in what an agent measured since its report before, if anything.

        All agents find the same cells in range of where it looked, and in the same order: readings need no addresses.
        """
        if report.looked is None:
            return
        looks = self._sensing.looks(report.looked_s, report.looked[None], np.array([report.agent]))
        if self._reads:
            found = np.empty(0) if report.readings is None else report.readings
            if found.size != looks.count:
                return
            looks = looks.with_value(found)
        self._known.take(looks)

    def receive(self, report: StateReport, own_sample: int) -> None:
        """Take in what another agent reports, at once or when its delay is over."""
        due = report.sample + self._delay
        if self._delay > 0 and own_sample < due:
            self._held.setdefault(due, []).append(report)
        else:
            self.take(report)

    def release_due(self, sample: int) -> None:
        """Take in what was held back until an own sample."""
        for due in sorted(due for due in self._held if due <= sample):
            for report in self._held.pop(due):
                self.take(report)
