"""Termination detection: an agent ends once it knows that everyone knows that everything is covered."""

from __future__ import annotations

from enum import Enum, auto
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mpc_cover.distributed.state_report import Report

_GONE_AFTER = 6
"""Samples beyond the way of a word and the silence of the lost after which someone is done without."""
_LINGER = 2
"""Samples beyond the way of a word for which whoever knows that all know goes on telling the others."""


class Termination(Enum):
    """How far an agent is with it."""

    OPEN = auto()
    KNOWN = auto()
    """It knows that everything is covered."""
    KNOWN_BY_ALL = auto()
    """It has just learnt that everyone knows."""
    LINGERING = auto()
    """It stays for those who may not have heard yet."""
    OVER = auto()


class TerminationDetector:
    """One agent's.

    Parameters
    ----------
    agents : m; a word gets around in so many samples.
    lost_after : samples of silence after which a neighbour is taken for lost.
    """

    def __init__(self, agents: int, lost_after: int) -> None:
        self._agents, self._patience = agents, agents + lost_after + _GONE_AFTER
        self._until: int | None = None

    def update(self, own: Report, newest: Mapping[int, Report], sample: int, *, at_rest: bool) -> Termination:
        """Take in the own state and the newest of each agent, the own one included; return how far it is."""
        if self._until is not None:
            return Termination.OVER if sample >= self._until else Termination.LINGERING
        if not own.complete:
            return Termination.OPEN
        if at_rest and all(self._knows(report, own.sample) for report in newest.values()):
            self._until = sample + self._agents + _LINGER
            return Termination.KNOWN_BY_ALL
        return Termination.KNOWN

    def _knows(self, report: Report, now: int) -> bool:
        """Return whether an agent knows that everything is covered, or has been silent for so long that it is gone."""
        return report.complete or now - report.sample > self._patience
