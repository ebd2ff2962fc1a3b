"""An agent's radio: it broadcasts to all agents, and receives only from those within rho_C.

The receiver drops the broadcasts of agents out of range, as a radio would, by the positions that the broadcast and its
own state give for the same sample.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.trajectory import SNAP_S
from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.decoding import Reason, RejectedError
from mpc_cover.service.protocol.fingerprint import mission_hash
from mpc_cover.service.protocol.keys import Keys, agent_of
from mpc_cover.service.protocol.messages import encode
from mpc_cover.service.swarm.radio_messages import FARTHEST_AHEAD, Codec, Word

if TYPE_CHECKING:
    from mpc_cover.distributed.state_report import StateReport
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.protocol.bus import Transport
    from mpc_cover.service.protocol.events import EventLog

_DEPTH = 4096
WORD = bus.Quality("INTERACTIVE_HIGH")


@dataclass(frozen=True, eq=False)
class Reception:
    """What one neighbour has broadcast.

    Attributes
    ----------
    sender : index of the neighbour in the fleet.
    reports : its own report, and those that it relays; of no sample that lies too far ahead.
    missing : the first sample of each agent that it has not received; empty where it does not say.
    """

    sender: int
    reports: list[StateReport]
    missing: tuple[int, ...]


class RadioLink:
    """The radio of one agent.

    Parameters
    ----------
    mission : whose agents communicate.
    identity : agent id and instance.
    transport : the network.
    events : where rejected broadcasts are reported.

    Attributes
    ----------
    sent : messages and bytes sent.
    rejected : broadcasts that were rejected, by reason.
    """

    def __init__(self, mission: Mission, identity: tuple[str, str], transport: Transport, events: EventLog) -> None:
        self._id, self._instance = identity
        self._mission, self._reach = mission_hash(mission), mission.fleet.communication_range
        self._events = events
        keys = Keys(mission.spec.name)
        self._publisher = transport.publisher(keys.word(self._id), WORD)
        self._inbox = transport.inbox(keys.word(), _DEPTH)
        self._in_range: frozenset[int] = frozenset()
        self.codec = Codec(mission)
        self.sent: Counter[str] = Counter()
        self.rejected: Counter[Reason] = Counter()

    def broadcast(
        self,
        own: StateReport,
        relayed: list[StateReport],
        *,
        start_s: float,
        missing: tuple[int, ...],
        owed: int,
        at_rest: bool,
    ) -> None:
        """Send the own report and those to relay; see `radio_messages.Word`."""
        word = Word(
            agent=self._id,
            instance=self._instance,
            mission=self._mission,
            start_s=start_s,
            own=self.codec.note(own),
            news=tuple(self.codec.note(each) for each in relayed),
            missing=missing,
            owed=owed,
            at_rest=at_rest,
        )
        payload = encode(word)
        self.sent.update(messages=1, bytes=len(payload))
        self._publisher.publish(payload)

    def receive(self, own: StateReport, start_s: float) -> list[Reception]:
        """Return what agents in range of the own state have broadcast since last time, of the flight begun then."""
        words = [word for word in self.drain() if abs(word.start_s - start_s) < SNAP_S]
        reports = [(self.codec.report(word.own), word) for word in words]
        near = frozenset(each.agent for each, _ in reports if not each.promised and self._reaches(each, own))
        # a promise came in the period before, when its sender was in range
        wide = near | self._in_range
        self._in_range = near
        heard = [(each, word) for each, word in reports if each.agent in (wide if each.promised else near)]
        return [self._reception(report, word, own.sample + FARTHEST_AHEAD) for report, word in heard]

    def drain(self) -> list[Word]:
        """Return what other agents have broadcast since last time, in range or not."""
        words = []
        for item in self._inbox.drain():
            try:
                word = self.codec.word(item.payload)
                self._check_sender(word, agent_of(item.key))
            except RejectedError as error:
                self._refuse(error)
            else:
                if word.agent != self._id:
                    words.append(word)
        for refused in self._inbox.take_refused():
            self._refuse(refused)
        return words

    def _refuse(self, error: RejectedError) -> None:
        self.rejected[error.reason] += 1
        self._events.emit(error.reason.name.lower(), f"ignores a word: {error}")

    def _reception(self, report: StateReport, word: Word, latest: int) -> Reception:
        """Decode a broadcast; reports of samples after `latest` are dropped."""
        every = [report, *(self.codec.report(note) for note in word.news)]
        return Reception(report.agent, [each for each in every if each.sample <= latest], word.missing)

    def _check_sender(self, word: Word, sender: str) -> None:
        if word.agent != sender:
            raise RejectedError(Reason.WRONG_AGENT, f"{word.agent} speaks on the key of {sender}")
        if word.mission != self._mission:
            raise RejectedError(Reason.WRONG_INSTANCE, f"{word.agent} flies another mission")

    def _reaches(self, report: StateReport, own: StateReport) -> bool:
        return float(np.linalg.norm(report.position - own.position)) <= self._reach
