"""Who is lost: agents that died or fell silent in flight, and those that came back."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.controller.fleet_monitor import AgentLink, FleetMonitor

DEAD_STATES = 3.0
"""An agent whose token is gone, but who was heard since, is lost after so many silent state periods, or a period."""
BROKEN_LINE_S = 0.5
"""A token that went after a longer silence [s of the machine's clock], or 1.5 state periods, went with the lease."""
SILENT_PART = 0.5
"""An agent with one is lost when it was silent for this part of the horizon: it may be hung."""


class FailureMode(Enum):
    """What a lost agent does."""

    BRAKES = "its process died: its own deadman brakes it, as hard as it can, and it stays there"
    FLIES_ON = "it cannot be heard: it flies its plan to the end, at rest"


class FailureDetector:
    """Keeps the list of the lost, by agent number.

    A process that dies takes its liveliness token along at once, a broken line only after the lease of a second: so
    an agent has died when it was heard until its token went.
    """

    def __init__(self, mission: Mission, fleet: FleetMonitor) -> None:
        control = mission.spec.control
        self.lost: dict[int, FailureMode] = {}
        self._fleet = fleet
        self._broken_s = max(BROKEN_LINE_S * fleet.speed, 1.5 * control.state_period_s)
        self._dead_s = min(DEAD_STATES * control.state_period_s, control.period_s)
        self._silent_s = SILENT_PART * control.horizon_steps * control.period_s

    def gone(self, now_s: float) -> dict[int, FailureMode]:
        """Return who is missing now and was not before."""
        present = set(self._fleet.present())
        fates: dict[int, FailureMode] = {}
        for index, link in enumerate(self._fleet.links):
            silent = link.silent_s(now_s)
            if index in self.lost:
                continue
            if link.id in self._fleet.reborn:
                fates[index] = FailureMode.BRAKES  # the one that was there before has died
            elif link.id not in present and (silent > self._dead_s or self._silent_since(link)):
                before_s = link.silent_s(self._fleet.token_went_s(link))
                fates[index] = FailureMode.BRAKES if before_s <= self._broken_s else FailureMode.FLIES_ON
            elif silent > self._silent_s:
                fates[index] = FailureMode.FLIES_ON
        return fates

    def back(self, now_s: float, patience_s: float) -> list[int]:
        """Return who of the lost is here, heard and at rest; whoever is heard in flight was not dead."""
        awaited = self._fleet.awaited(now_s, patience_s)
        back = []
        for index in self.lost:
            link = self._fleet.links[index]
            if link.id in self._fleet.reborn:
                self.lost[index] = FailureMode.BRAKES
            elif link.id not in awaited:
                back.append(index)
            elif self._flies(link, now_s):
                self.lost[index] = FailureMode.FLIES_ON
        return back

    def ids(self) -> list[str]:
        """Return the names of the lost."""
        return [link.id for index, link in enumerate(self._fleet.links) if index in self.lost]

    def _silent_since(self, link: AgentLink) -> bool:
        """Return whether nothing was heard since an agent's token went: with a process, both end at once."""
        return link.measured_s() + link.delay_s <= self._fleet.token_went_s(link)

    def _flies(self, link: AgentLink, now_s: float) -> bool:
        """Return whether an agent was heard in flight since it was lost: its last words before that tell nothing."""
        heard = link.silent_s(now_s) <= self._dead_s and not self._silent_since(link)
        return heard and link.state is not None and link.state.plan is not None and not link.state.at_rest
