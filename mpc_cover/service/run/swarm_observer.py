"""Observes a fleet that flies without a controller: its status, from the agents' broadcasts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpc_cover.service.protocol.decoding import RejectedError
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.protocol.messages import Phase, Status
from mpc_cover.service.run.observer import read_events
from mpc_cover.service.swarm.radio_messages import Codec

if TYPE_CHECKING:
    from mpc_cover.clock import Clock
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.protocol.bus import Transport
    from mpc_cover.service.swarm.radio_messages import Word

_DEPTH = 8192


class SwarmObserver:
    """Receives the broadcasts of all agents at any distance, and sends nothing.

    Attributes
    ----------
    status : as a controller would report it: covered is what the best-informed agent knows of.
    words : the newest broadcast of each agent, by id.
    """

    def __init__(self, mission: Mission, transport: Transport, clock: Clock) -> None:
        keys = Keys(mission.spec.name)
        self.status: Status | None = None
        self.words: dict[str, Word] = {}
        self._clock, self._cells, self._codec = clock, mission.field.size, Codec(mission)
        self._inbox = transport.inbox(keys.word(), _DEPTH)
        self._events = transport.inbox(keys.agent_event(), _DEPTH)
        self._seq = 0

    def look(self) -> list[str]:
        """Take in what was received; return the texts of the new events."""
        for item in self._inbox.drain():
            try:
                word = self._codec.word(item.payload)
            except RejectedError:
                continue
            self.words[word.agent] = word
        if self.words:
            self.status = self._status()
        return read_events(self._events)

    def _status(self) -> Status:
        words = list(self.words.values())
        self._seq += 1
        owed = min(word.owed for word in words)
        return Status(
            controller="none",
            epoch=0,
            seq=self._seq,
            phase=Phase.COMPLETE if all(word.own.complete for word in words) else Phase.FLYING,
            mission_time_s=max(0.0, *(word.own.time_s for word in words)),
            covered_count=max(0, self._cells - owed),
            cell_count=self._cells,
            present=sorted(self.words),
        )
