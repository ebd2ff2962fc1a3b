"""Recovery: the modes of the controller and the transitions between them.

`next_mode` is a pure function of the mode and of the situation that a step has found; tests tabulate every transition.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray

_POOR_SHARE = 0.5
"""Part of the outstanding demand: plans that leave more than it are planned again at rest. Plain choice."""
_ATTEMPTS = 3
"""Searches at rest in a row before a poor plan is flown, each twice as long as the last; a plain choice."""
_LONG_SEARCH_S = 16.0
"""Planning time [s] up to which the number of attempts is raised where missions plan fast; a plain choice. A short
planning time must not strand a fleet."""
_SAME_POSITION = 1e-3
"""Agents that move less than this along each axis stay where they are [m]; plain choice."""


class Mode(Enum):
    """What the controller has the fleet do."""

    NOMINAL = "covers the outstanding demand"
    RENDEZVOUS = "closes the gaps between groups that are out of range of each other"
    REPLAN_AT_REST = "comes to rest, where there is time to plan thoroughly"
    STOP = "comes to rest: nothing is left to do"
    BRAKE = "brakes: no verified plan is left to fly"


@dataclass(frozen=True)
class Situation:
    """The situation that a step has found so far.

    Attributes
    ----------
    settled : the whole fleet is at rest and waits for a plan: there is time for a thorough search.
    work_left : the active agents can measure something that is still demanded.
    disconnected : active agents are out of range of each other, or cannot stop before they are.
    disconnected_by_loss : out of range after the loss of an agent: a rendezvous follows even when nothing is demanded.
    rendezvous_possible : a verified motion that closes all gaps is known; True until a search has failed.
    no_plan_found : a search found no plan for the demand, and there is no earlier plan.
    range_infeasible : no motion from the present state keeps the communication range.
    on_plan : the mission plan in progress satisfies the constraints.
    worth_replanning : the plan is so poor, or was found so late, that a thorough search at rest is worth while.
    safe : a verified plan can be sent or continued.
    """

    settled: bool = False
    work_left: bool = True
    disconnected: bool = False
    disconnected_by_loss: bool = False
    rendezvous_possible: bool = True
    no_plan_found: bool = False
    range_infeasible: bool = False
    on_plan: bool = False
    worth_replanning: bool = False
    safe: bool = True


def next_mode(mode: Mode, situation: Situation) -> Mode:
    """Return the mode that follows.

    In order of priority: safety; a fleet that is coming to rest for a thorough search completes that; a rendezvous of
    agents that are, or are about to be, out of range; the mission.
    """
    if not situation.safe:
        return Mode.BRAKE
    if mode is Mode.REPLAN_AT_REST and not situation.settled:
        return Mode.REPLAN_AT_REST
    if not situation.work_left and (situation.settled or not situation.disconnected_by_loss):
        return Mode.STOP
    gap = situation.disconnected and (mode is Mode.RENDEZVOUS or not situation.on_plan)
    if (gap or (situation.no_plan_found and situation.range_infeasible)) and situation.rendezvous_possible:
        return Mode.RENDEZVOUS
    return Mode.REPLAN_AT_REST if situation.worth_replanning else Mode.NOMINAL


@dataclass(frozen=True, eq=False)
class ReplanHistory:
    """Failed searches at rest, and where the fleet was last stranded: they bound how often it plans again.

    Attributes
    ----------
    planning_s : planning time of the first thorough search [s].
    failed_attempts : thorough searches in a row without a plan worth flying.
    position : (m, d) [m] where the fleet was last stranded, None if never.
    demand : total demand outstanding then.
    """

    planning_s: float
    failed_attempts: int = 0
    position: FloatArray | None = None
    demand: float = np.inf

    @property
    def time_factor(self) -> float:
        """Factor on the planning time at rest: it doubles with each failed attempt."""
        return float(2.0**self.failed_attempts)

    def after(self, mode: Mode) -> ReplanHistory:
        """Return the history after a thorough search that ended in `mode`."""
        return replace(self, failed_attempts=self.failed_attempts + 1 if mode is Mode.REPLAN_AT_REST else 0)

    def is_poor(self, left: FloatArray, demand: FloatArray) -> bool:
        """Return whether a plan that leaves weights `left` of a `demand`, (J, K) each, is to be replaced at rest."""
        most = max(_ATTEMPTS, int(np.ceil(np.log2(_LONG_SEARCH_S / self.planning_s))))
        return self.failed_attempts < most and bool(np.count_nonzero(left) > _POOR_SHARE * np.count_nonzero(demand))

    def stranded(self, here: FloatArray, demand: float) -> tuple[bool, ReplanHistory]:
        """Return whether a fleet at rest at (m, d) [m] without a plan should search thoroughly, and the new history.

        At the same position again only if less is outstanding than the last time.
        """
        if self.position is not None and demand >= self.demand and stays_at(self.position, here):
            return False, self
        return True, replace(self, position=here, demand=demand)


def stays_at(position: FloatArray, here: FloatArray) -> bool:
    """Return whether positions (..., m, d) [m] never leave `here` (m, d) [m]."""
    return bool((np.abs(position - here) < _SAME_POSITION).all())
