"""Events for users and for the network, at a limited rate."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpc_cover.service.protocol.messages import Event, encode

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.clock import Clock
    from mpc_cover.service.protocol.bus import Publisher

QUIET_S = 1.0
"""Shortest time between two events of the same kind [s]; others are dropped."""


class EventLog:
    """Publishes the events of a source, and passes their texts to `say`."""

    def __init__(
        self, source: str, publisher: Publisher, clock: Clock, say: Callable[[str], None] | None = None
    ) -> None:
        self._source = source
        self._publisher = publisher
        self._clock = clock
        self._say = say
        self._last: dict[str, float] = {}
        self._seq = 0

    def emit(self, kind: str, text: str) -> None:
        """Publish an event, unless one of this kind was published just now."""
        now = self._clock.now()
        if now - self._last.get(kind, -QUIET_S) < QUIET_S and kind in self._last:
            return
        self._last[kind] = now
        event = Event(source=self._source, seq=self._seq, time_s=now, kind=kind, text=text[:1000])
        self._seq += 1
        self._publisher.publish(encode(event))
        if self._say:
            self._say(f"{self._source}: {text}")
