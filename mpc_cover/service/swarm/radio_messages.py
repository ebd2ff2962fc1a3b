"""What agents of the distributed law broadcast to those within range, and its encoding; see `distributed.state_report`.

Payloads are JSON with a schema version like all others (`messages`); a malformed one is a counted rejection.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import msgspec
import numpy as np

from mpc_cover.distributed.state_report import StateReport
from mpc_cover.service.protocol.decoding import Reason, RejectedError, decode_with, require_finite
from mpc_cover.service.protocol.messages import Count, Id, Message, Vector

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mpc_cover.mission.load import Mission

FARTHEST_AHEAD = 2
"""A report may be so many samples ahead of the agent that receives it; more is implausible."""


class Hello(Message, frozen=True, kw_only=True):
    """The announcement of an agent that waits for the others; `present` are all agents that it knows to be waiting.

    `start_s` is when the flight begins, by the clock that all share; None until the first agent has chosen it. `speed`
    is how many seconds of that clock pass in a second, `time_s` is now.
    """

    agent: Id
    instance: Id
    mission: Id
    seed: Count
    speed: float
    time_s: float
    position: Vector
    present: tuple[Id, ...] = ()
    start_s: float | None = None


class Note(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A `StateReport` as it is sent: agents by name, SI units, mission time."""

    agent: Id
    sample: Count
    time_s: float
    position: Vector
    velocity: Vector
    heard: tuple[Id, ...] = ()
    promised: bool = False
    looked: Vector | None = None
    looked_s: float = 0.0
    complete: bool = False
    readings: Annotated[tuple[float, ...], msgspec.Meta(max_length=100_000)] = ()


class Word(Message, frozen=True, kw_only=True):
    """The broadcast of an agent in flight: its own report, those that it relays, and what it has not received.

    `news` are the relayed reports, `missing` the first sample of each agent that it has not received. `owed` is how
    many cells are owed by its own map, `start_s` when the flight began by the clock that all share.
    """

    agent: Id
    instance: Id
    mission: Id
    start_s: float
    own: Note
    news: Annotated[tuple[Note, ...], msgspec.Meta(max_length=4000)] = ()
    missing: Annotated[tuple[Count, ...], msgspec.Meta(max_length=64)] = ()
    owed: Count = 0
    at_rest: bool = False


_HELLO = msgspec.json.Decoder(Hello)
_WORD = msgspec.json.Decoder(Word)


class Codec:
    """Encodes and decodes the state reports of a mission's agents.

    Parameters
    ----------
    mission : whose agents broadcast.
    """

    def __init__(self, mission: Mission) -> None:
        self._ids = mission.fleet.ids
        self._index = {name: index for index, name in enumerate(self._ids)}
        self._dimension = mission.fleet.dimension

    def note(self, report: StateReport) -> Note:
        """Return a report as it is sent."""
        return Note(
            agent=self._ids[report.agent],
            sample=report.sample,
            time_s=report.time_s,
            position=report.position.tolist(),
            velocity=report.velocity.tolist(),
            heard=tuple(self._ids[j] for j in sorted(report.heard)),
            promised=report.promised,
            looked=None if report.looked is None else report.looked.tolist(),
            looked_s=report.looked_s,
            complete=report.complete,
            readings=() if report.readings is None else tuple(report.readings.tolist()),
        )

    def report(self, note: Note) -> StateReport:
        """Return the report in a note that this codec has decoded."""
        return StateReport(
            self._index[note.agent],
            note.sample,
            note.time_s,
            np.array(note.position),
            np.array(note.velocity),
            frozenset(self._index[name] for name in note.heard),
            note.promised,
            None if note.looked is None else np.array(note.looked),
            note.looked_s,
            note.complete,
            np.array(note.readings) if note.readings else None,
        )

    def hello(self, payload: bytes) -> Hello:
        """Return the announcement of one of the mission's agents.

        Raises
        ------
        RejectedError
            It is anything else.
        """
        hello = decode_with(_HELLO, payload)
        start = () if hello.start_s is None else (hello.start_s,)
        self._check((hello.agent, *hello.present), (hello.position,), (hello.speed, hello.time_s, *start))
        return hello

    def word(self, payload: bytes) -> Word:
        """Return the broadcast of one of the mission's agents about itself, with relayed reports of the others.

        Raises
        ------
        RejectedError
            It is anything else.
        """
        word = decode_with(_WORD, payload)
        self._check((word.agent,), (), (word.start_s,))
        if word.own.agent != word.agent or len(word.missing) not in {0, len(self._ids)}:
            raise RejectedError(Reason.WRONG_AGENT, f"{word.agent} speaks for {word.own.agent}")
        for note in (word.own, *word.news):
            vectors = (note.position, note.velocity, *(() if note.looked is None else (note.looked,)))
            self._check((note.agent, *note.heard), vectors, (note.time_s, note.looked_s, *note.readings))
        return word

    def _check(self, names: Iterable[str], vectors: Iterable[list[float]], numbers: Iterable[float]) -> None:
        if unknown := [name for name in names if name not in self._index]:
            raise RejectedError(Reason.WRONG_AGENT, f"{unknown[0]} is not in the mission")
        require_finite(numbers)
        for vector in vectors:
            if len(vector) != self._dimension:
                raise RejectedError(Reason.SHAPE, f"must have {self._dimension} coordinates")
            require_finite(vector)
