"""The demo's own observer of the network: it receives the agents' states even while the controller is down."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpc_cover.service.protocol.decoding import RejectedError, decode_event, decode_state, decode_status
from mpc_cover.service.protocol.keys import Keys

if TYPE_CHECKING:
    from collections.abc import Collection

    from mpc_cover.clock import Clock
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.protocol.bus import Inbox, Transport
    from mpc_cover.service.protocol.messages import State, Status

DEPTH = 4096


class Observer:
    """Receives the newest status and states, and the events.

    Attributes
    ----------
    status : the controller's newest; None before the first.
    """

    def __init__(self, mission: Mission, transport: Transport, clock: Clock) -> None:
        keys = Keys(mission.spec.name)
        self.status: Status | None = None
        self._clock = clock
        self._ids = mission.fleet.ids
        self._dimension = mission.fleet.dimension
        self._states: dict[str, tuple[State, float]] = {}
        self._state_inbox = transport.inbox(keys.state(), DEPTH)
        self._status_inbox = transport.inbox(keys.status, DEPTH, history=1)
        self._event_inboxes = [transport.inbox(key, DEPTH) for key in (keys.controller_event, keys.agent_event())]

    def look(self) -> list[str]:
        """Take in what was received; return the texts of the new events."""
        for item in self._state_inbox.drain():
            try:
                state = decode_state(item.payload, self._dimension)
            except RejectedError:
                continue
            self._states[state.agent] = (state, item.received_s)
        for item in self._status_inbox.drain():
            try:
                self.status = decode_status(item.payload)
            except RejectedError:
                continue
        return self._events()

    def at_rest(self, patience_s: float, without: Collection[str] = ()) -> bool:
        """Return whether every agent, except those `without`, was heard within `patience_s` and is at rest."""
        now = self._clock.now()
        known = [self._states.get(name) for name in self._ids if name not in without]
        return all(entry and now - entry[1] <= patience_s and entry[0].at_rest for entry in known)

    def _events(self) -> list[str]:
        return [text for inbox in self._event_inboxes for text in read_events(inbox)]


def read_events(inbox: Inbox) -> list[str]:
    """Return the texts of the events received since last time; malformed ones are ignored."""
    events = []
    for item in inbox.drain():
        try:
            event = decode_event(item.payload)
        except RejectedError:
            continue
        events.append(f"{event.source}: {event.text}")
    return events
