"""An agent's radio: it speaks to everyone, and hears only those within rho_C.

What those out of range say is dropped by the receiver, by the positions that a word and the agent's own state tell
of the same sample, as a radio would.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.trajectory import SNAP_S
from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.decoding import Reason, RejectedError
from mpc_cover.service.protocol.fingerprint import mission_hash
from mpc_cover.service.protocol.keys import Keys, agent_of
from mpc_cover.service.protocol.messages import encode
from mpc_cover.service.swarm.radio import Codec, Word

if TYPE_CHECKING:
    from mpc_cover.distributed.state_report import Report
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.protocol.bus import Transport
    from mpc_cover.service.protocol.events import EventLog

_DEPTH = 4096
WORD = bus.Quality("INTERACTIVE_HIGH")


class RadioLink:
    """One agent's.

    Parameters
    ----------
    mission : of all who speak here.
    identity : agent id and instance.
    transport : handed in.
    events : told what is turned away.

    Attributes
    ----------
    sent : messages and bytes sent.
    rejected : words turned away, by reason.
    """

    def __init__(self, mission: Mission, identity: tuple[str, str], transport: Transport, events: EventLog) -> None:
        self._id, self._instance = identity
        self._mission, self._reach = mission_hash(mission), mission.fleet.communication_range
        self._events = events
        keys = Keys(mission.spec.name)
        self._said = transport.publisher(keys.word(self._id), WORD)
        self._heard = transport.inbox(keys.word(), _DEPTH)
        self._in_range: frozenset[int] = frozenset()
        self.codec = Codec(mission)
        self.sent: Counter[str] = Counter()
        self.rejected: Counter[Reason] = Counter()

    def say(
        self, own: Report, news: list[Report], *, start_s: float, missing: tuple[int, ...], owed: int, at_rest: bool
    ) -> None:
        """Send a word; see `radio.Word`."""
        word = Word(
            agent=self._id,
            instance=self._instance,
            mission=self._mission,
            start_s=start_s,
            own=self.codec.note(own),
            news=tuple(self.codec.note(each) for each in news),
            missing=missing,
            owed=owed,
            at_rest=at_rest,
        )
        payload = encode(word)
        self.sent.update(messages=1, bytes=len(payload))
        self._said.publish(payload)

    def hear(self, own: Report, start_s: float) -> list[tuple[Report, Word]]:
        """Return what those in range of the own state have said since last time, of the flight that began then."""
        words = [word for word in self.drain() if abs(word.start_s - start_s) < SNAP_S]
        reports = [(self.codec.report(word.own), word) for word in words]
        near = frozenset(each.agent for each, _ in reports if not each.promised and self._reaches(each, own))
        # a promise came in the period before, when its sender was in range
        wide = near | self._in_range
        self._in_range = near
        return [(each, word) for each, word in reports if each.agent in (wide if each.promised else near)]

    def drain(self) -> list[Word]:
        """Return what others have said since last time, whoever and wherever they are."""
        words = []
        for item in self._heard.drain():
            try:
                word = self.codec.word(item.payload)
                self._check_sender(word, agent_of(item.key))
            except RejectedError as error:
                self.rejected[error.reason] += 1
                self._events.tell(error.reason.name.lower(), f"ignores a word: {error}")
            else:
                if word.agent != self._id:
                    words.append(word)
        return words

    def _check_sender(self, word: Word, sender: str) -> None:
        if word.agent != sender:
            raise RejectedError(Reason.WRONG_AGENT, f"{word.agent} speaks on the key of {sender}")
        if word.mission != self._mission:
            raise RejectedError(Reason.WRONG_INSTANCE, f"{word.agent} flies another mission")

    def _reaches(self, report: Report, own: Report) -> bool:
        return float(np.linalg.norm(report.position - own.position)) <= self._reach
