"""What the fleet does when all is not well: the modes of the controller, and when it changes from one to another.

`next_mode` is a pure function of the mode and of what a step has found; a table of tests holds each transition.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray

_POOR, _ATTEMPTS = 0.5, 3
"""Plans that leave more than this part of what is owed are planned again at rest, so many times, each twice as long."""
_LONG_S = 16.0
"""More often than that, until planning took so long [s]: a short planning time must not strand a fleet."""
_SAME_PLACE = 1e-3
"""Who moves less than this stays where it is [m]."""


class Mode(Enum):
    """What the controller does with the fleet."""

    NOMINAL = "covers what is owed"
    RENDEZVOUS = "closes the gaps between groups that are out of range of each other"
    REPLAN_AT_REST = "comes to rest, where there is time to plan thoroughly"
    STOP = "comes to rest: nothing is left to do"
    BRAKE = "brakes: no verified plan is left to fly"


@dataclass(frozen=True)
class Situation:
    """What a step has found so far.

    Attributes
    ----------
    settled : the whole fleet is at rest and waits for a plan: there is time to plan thoroughly.
    work_left : something is owed that those who take part can measure.
    disconnected : those who take part are out of range of each other, or cannot stop before they are.
    disconnected_by_loss : the same, after the loss of an agent: they meet again even when nothing is owed.
    rendezvous_possible : a verified way on which all gaps close is known; True until it was looked for.
    no_plan_found : a search found no plan for what is owed, and none is left from before.
    range_infeasible : the range cannot be kept from here.
    on_plan : a mission plan is flown that keeps the constraints.
    worth_replanning : what was found is so poor, or came so late, that thorough planning at rest promises more.
    safe : a verified plan can be sent, or goes on.
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
    """Return what to do next.

    Safety comes before all else; a fleet that has begun to come to rest for a thorough plan goes through with it;
    then those who may lose each other meet, and then the mission goes on.
    """
    if not situation.safe:
        return Mode.BRAKE
    if mode is Mode.REPLAN_AT_REST and not situation.settled:
        return Mode.REPLAN_AT_REST
    if not situation.work_left and (situation.settled or not situation.disconnected_by_loss):
        return Mode.STOP
    apart = situation.disconnected and (mode is Mode.RENDEZVOUS or not situation.on_plan)
    if (apart or (situation.no_plan_found and situation.range_infeasible)) and situation.rendezvous_possible:
        return Mode.RENDEZVOUS
    return Mode.REPLAN_AT_REST if situation.worth_replanning else Mode.NOMINAL


@dataclass(frozen=True, eq=False)
class ReplanHistory:
    """How often thorough planning was in vain, and where the fleet was stranded last, so that it ends some day.

    Attributes
    ----------
    planning_s : how long the first thorough planning takes.
    failed_attempts : thorough plannings in a row that came to nothing worth flying.
    place : (m, d) [m] where the fleet was last stranded, None if nowhere.
    owed : how much was owed then.
    """

    planning_s: float
    failed_attempts: int = 0
    place: FloatArray | None = None
    owed: float = np.inf

    @property
    def time_factor(self) -> float:
        """How many times as long as usual thorough planning may take: it doubles whenever one was too short."""
        return float(2.0**self.failed_attempts)

    def after(self, mode: Mode) -> ReplanHistory:
        """Return the history after a thorough planning that ended in `mode`."""
        return replace(self, failed_attempts=self.failed_attempts + 1 if mode is Mode.REPLAN_AT_REST else 0)

    def is_poor(self, left: FloatArray, owed: FloatArray) -> bool:
        """Return whether a plan that leaves weights (J, K) of those owed is worth planning again at rest."""
        most = max(_ATTEMPTS, int(np.ceil(np.log2(_LONG_S / self.planning_s))))
        return self.failed_attempts < most and bool(np.count_nonzero(left) > _POOR * np.count_nonzero(owed))

    def stranded(self, here: FloatArray, owed: float) -> tuple[bool, ReplanHistory]:
        """Return whether a fleet at rest at (m, d) [m] that finds no way on should plan thoroughly, and the history.

        At the same place again only if less is owed than the last time.
        """
        if self.place is not None and owed >= self.owed and stays_at(self.place, here):
            return False, self
        return True, replace(self, place=here, owed=owed)


def stays_at(position: FloatArray, here: FloatArray) -> bool:
    """Return whether positions (..., m, d) [m] never leave `here` (m, d)."""
    return bool((np.abs(position - here) < _SAME_PLACE).all())
