"""Detects agents that fail or fall silent in flight, and those that recover."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.controller.fleet_monitor import AgentLink, FleetMonitor

TOKEN_LOST_PERIODS = 3.0
"""An agent heard after its token was lost is lost after so many silent state periods, or a control period."""
LINK_SILENCE_S = 0.5
"""A token lost after a longer silence [s of the machine's clock], or 1.5 state periods, was lost with the lease."""
SILENT_PART = 0.5
"""An agent with a token is lost when it is silent for this part of the horizon: its process may hang."""


class FailureMode(Enum):
    """Why an agent is lost, and so how it moves."""

    PROCESS_DIED = "its process died: its own deadman brakes it, as hard as it can, and it stays there"
    LINK_LOST = "it cannot be heard: it flies its plan to the end, at rest"
    CONTRADICTS = "it reports places where its plan does not lead: it flies any plan that it was sent, or stays there"


class FailureDetector:
    """Keeps the lost agents with their failure modes, by agent number: `lost`.

    A process that dies loses its liveliness token at once, a broken link only after the lease of a second: so
    the process of an agent has died if the agent was heard until its token was lost.
    """

    def __init__(self, mission: Mission, fleet: FleetMonitor) -> None:
        control = mission.spec.control
        self.lost: dict[int, FailureMode] = {}
        self._fleet = fleet
        self._link_silence_s = max(LINK_SILENCE_S * fleet.speed, 1.5 * control.state_period_s)
        self._token_lost_s = min(TOKEN_LOST_PERIODS * control.state_period_s, control.period_s)
        self._timeout_s = SILENT_PART * control.horizon_s

    def newly_lost(self, now_s: float) -> dict[int, FailureMode]:
        """Return the agents that are lost now and were not before, with their failure modes."""
        present = set(self._fleet.present())
        failures: dict[int, FailureMode] = {}
        for index, link in enumerate(self._fleet.links):
            silence_s = link.silence_s(now_s)
            if index in self.lost:
                continue
            if link.id in self._fleet.restarted:
                failures[index] = FailureMode.PROCESS_DIED  # the process before it
            elif link.id not in present and (silence_s > self._token_lost_s or self._silent_since_token(link)):
                before_s = link.silence_s(self._fleet.token_lost_s(link))
                died = before_s <= self._link_silence_s
                failures[index] = FailureMode.PROCESS_DIED if died else FailureMode.LINK_LOST
            elif silence_s > self._timeout_s:
                failures[index] = FailureMode.LINK_LOST
        return failures

    def recovered(self, now_s: float, patience_s: float) -> list[int]:
        """Return the lost agents that are present, heard and at rest; one heard in flight had only lost its link."""
        not_ready = self._fleet.not_ready(now_s, patience_s)
        recovered = []
        for index in self.lost:
            link = self._fleet.links[index]
            if link.id in self._fleet.restarted:
                self.lost[index] = FailureMode.PROCESS_DIED
            elif link.id not in not_ready:
                recovered.append(index)
            elif self.lost[index] is not FailureMode.CONTRADICTS and self._flies(link, now_s):
                self.lost[index] = FailureMode.LINK_LOST
        return recovered

    def lost_ids(self) -> list[str]:
        """Return the ids of the lost agents."""
        return [link.id for index, link in enumerate(self._fleet.links) if index in self.lost]

    def _silent_since_token(self, link: AgentLink) -> bool:
        """Return whether nothing was heard since an agent's token was lost: when a process dies, both end at once."""
        return link.measured_s() + link.delay_s <= self._fleet.token_lost_s(link)

    def _flies(self, link: AgentLink, now_s: float) -> bool:
        """Return whether an agent was heard in flight since its loss: reports from before that do not count."""
        heard = link.silence_s(now_s) <= self._token_lost_s and not self._silent_since_token(link)
        return heard and link.state is not None and link.state.plan is not None and not link.state.at_rest
