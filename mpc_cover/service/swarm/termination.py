"""Termination detection: an agent ends once it knows that all agents know that everything is covered."""

from __future__ import annotations

from enum import Enum, auto
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mpc_cover.distributed.state_report import StateReport

_GONE_AFTER = 6
"""Samples, beyond a report's way through the fleet and the timeout of the lost, after which an agent is given up."""
_LINGER = 2
"""Samples, beyond a report's way through the fleet, for which an agent that may end keeps informing the others."""


class Termination(Enum):
    """How far an agent is from ending."""

    OPEN = auto()
    KNOWN = auto()
    """It knows that everything is covered."""
    KNOWN_BY_ALL = auto()
    """It has just learnt that all agents know."""
    LINGERING = auto()
    """It keeps informing agents that may not know yet."""
    OVER = auto()


class TerminationDetector:
    """The termination detector of one agent.

    Parameters
    ----------
    agents : m; a report reaches every agent within so many samples.
    lost_after : samples of silence after which a neighbour is taken for lost.
    """

    def __init__(self, agents: int, lost_after: int) -> None:
        self._agents, self._patience = agents, agents + lost_after + _GONE_AFTER
        self._until: int | None = None

    def update(self, own: StateReport, newest: Mapping[int, StateReport], sample: int, *, at_rest: bool) -> Termination:
        """Take in the own report and the newest of each agent, the own one included; return how far the agent is."""
        if self._until is not None:
            return Termination.OVER if sample >= self._until else Termination.LINGERING
        if not own.complete:
            return Termination.OPEN
        if at_rest and all(self._knows(report, own.sample) for report in newest.values()):
            self._until = sample + self._agents + _LINGER
            return Termination.KNOWN_BY_ALL
        return Termination.KNOWN

    def _knows(self, report: StateReport, now: int) -> bool:
        """Return whether an agent knows that everything is covered, or has been silent for so long that it is gone."""
        return report.complete or now - report.sample > self._patience
