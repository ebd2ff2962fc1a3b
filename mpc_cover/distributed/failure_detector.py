"""Which neighbours an agent expects to hear, and when it takes silence for a loss.

Silence is harmless as long as no agent moves on outdated states. An agent that misses a neighbour's state of this
sample brakes, for which the neighbour's safe set leaves room (`double_integrator_filter`). So does one that a
neighbour reports as not heard. A neighbour that stays silent is taken for lost.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mpc_cover.arrays import BoolArray, IntArray
    from mpc_cover.distributed.state_report import StateReport
    from mpc_cover.mission.fleet import Fleet

_LEAVES_AFTER = 2
"""Samples for which a silent neighbour is expected that may just have left the range."""


class NeighbourFailureDetector:
    """One agent's list of neighbours.

    Parameters
    ----------
    fleet : all agents.
    index : which of them this is.
    period_s : T_s.
    lost_after : samples of silence after which a neighbour is lost; it must be at rest by then.

    Attributes
    ----------
    lost : (m,) which agents are taken for lost.
    heard_before : the agents whose state was known at the last decision.
    """

    def __init__(self, fleet: Fleet, index: int, period_s: float, lost_after: int) -> None:
        self._fleet, self._index, self._period_s, self._lost_after = fleet, index, period_s, lost_after
        self._near: set[int] = set()
        self._leaving: set[int] = set()
        self._silence: IntArray = np.zeros(fleet.size, dtype=np.intp)
        self.lost: BoolArray = np.zeros(fleet.size, dtype=bool)
        self.heard_before: frozenset[int] = frozenset()

    def must_brake(self, own: StateReport, newest: Mapping[int, StateReport]) -> bool:
        """Return whether a neighbour is silent or has not heard this agent; remember which to expect next.

        To be called once a sample.
        """
        reach = self._fleet.communication_range
        others = {j: report for j, report in newest.items() if j != self._index}
        now = {j for j, report in others.items() if report.sample == own.sample}
        for j in others.keys() - now:
            self._count_silence(j, own, others[j])
        unsure = any(j not in now or self._index not in others[j].heard for j in self._near)
        in_range = {j for j in now if np.linalg.norm(others[j].position - own.position) <= reach}
        self._near = (self._near - now) | in_range
        self._leaving -= now
        self._silence[list(now)] = 0
        self.heard_before = frozenset(now)
        return unsure

    def _count_silence(self, j: int, own: StateReport, last: StateReport) -> None:
        """Expect a silent neighbour for a while; then it has left the range, if it could, or is lost."""
        if j not in self._near:
            return
        self._silence[j] += 1
        away = float(np.linalg.norm(last.position - own.position))
        reach = self._fleet.communication_range
        if self._silence[j] == 1 and away + self._period_s * self._fleet.speed_max[j] > reach:
            self._leaving.add(j)
        if self._silence[j] > (_LEAVES_AFTER if j in self._leaving else self._lost_after):
            self._near.discard(j)
            self.lost[j] = j not in self._leaving
