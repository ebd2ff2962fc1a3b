"""An in-memory bus: deterministic, for `simulate` and the tests."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpc_cover.service.protocol.bus import Inbox, Presence, Quality, Received, Request, RequestError, RequestInbox
from mpc_cover.service.protocol.keys import matches

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.clock import Clock


class LocalBus:
    """Delivers at once, in the order of publication.

    `channel` models the channel: it returns the payloads that arrive when one is sent on a key.
    """

    def __init__(self, clock: Clock, channel: Callable[[str, bytes], list[bytes]] | None = None) -> None:
        self.clock = clock
        self.channel = channel
        self._inboxes: list[tuple[LocalTransport, str, Inbox]] = []
        self._presences: list[tuple[LocalTransport, str, Presence]] = []
        self._requests: list[tuple[LocalTransport, str, RequestInbox]] = []
        self._tokens: list[tuple[LocalTransport, str]] = []
        self._history: dict[str, deque[bytes]] = {}

    def join(self) -> LocalTransport:
        """Return a new participant."""
        return LocalTransport(self)

    def send(self, key: str, payload: bytes, quality: Quality) -> None:
        """Deliver to every matching inbox."""
        if quality.history:
            self._history.setdefault(key, deque(maxlen=quality.history)).append(payload)
        for arrived in [payload] if self.channel is None else self.channel(key, payload):
            for _, pattern, inbox in self._inboxes:
                if matches(pattern, key):
                    inbox.put(Received(key, arrived, self.clock.now()))

    def subscribe(self, owner: LocalTransport, pattern: str, inbox: Inbox, history: int) -> None:
        """Add an inbox, with the past samples that it asks for."""
        self._inboxes.append((owner, pattern, inbox))
        for key, past in self._history.items():
            if history and matches(pattern, key):
                for payload in list(past)[-history:]:
                    inbox.put(Received(key, payload, self.clock.now()))

    def announce(self, owner: LocalTransport, key: str) -> None:
        """Add a liveliness token."""
        self._tokens.append((owner, key))
        for _, pattern, presence in self._presences:
            if matches(pattern, key):
                presence.set(key, alive=True, time_s=self.clock.now())

    def tokens(self) -> list[str]:
        """Return the keys of all tokens."""
        return [key for _, key in self._tokens]

    def watch(self, owner: LocalTransport, pattern: str, presence: Presence) -> None:
        """Keep `presence` up to date."""
        self._presences.append((owner, pattern, presence))
        for _, key in self._tokens:
            if matches(pattern, key):
                presence.set(key, alive=True, time_s=self.clock.now())

    def answer(self, owner: LocalTransport, pattern: str, requests: RequestInbox) -> None:
        """Deliver matching requests to `requests`."""
        self._requests.append((owner, pattern, requests))

    def ask(self, request: Request) -> None:
        """Deliver a request to all participants that answer its key."""
        for _, pattern, requests in self._requests:
            if matches(pattern, request.key):
                requests.put(request)

    def leave(self, owner: LocalTransport) -> None:
        """Remove a participant, as when its process dies."""
        gone = [key for token_owner, key in self._tokens if token_owner is owner]
        self._tokens = [token for token in self._tokens if token[0] is not owner]
        self._inboxes = [entry for entry in self._inboxes if entry[0] is not owner]
        self._presences = [entry for entry in self._presences if entry[0] is not owner]
        self._requests = [entry for entry in self._requests if entry[0] is not owner]
        for key in gone:
            for _, pattern, presence in self._presences:
                if matches(pattern, key):
                    presence.set(key, alive=False, time_s=self.clock.now())


@dataclass(frozen=True)
class _LocalPublisher:
    transport: LocalTransport
    key: str
    quality: Quality

    def publish(self, payload: bytes) -> None:
        if not self.transport.closed:
            self.transport.bus.send(self.key, payload, self.quality)


class LocalTransport:
    """One participant of a `LocalBus`; see `bus.Transport`."""

    signed = False

    def __init__(self, bus: LocalBus) -> None:
        self.bus = bus
        self.closed = False

    @property
    def callback_errors(self) -> int:
        """There are no callbacks here."""
        return 0

    def publisher(self, key: str, quality: Quality) -> _LocalPublisher:
        """Return the publisher of a key."""
        return _LocalPublisher(self, key, quality)

    def inbox(self, pattern: str, depth: int, *, history: int = 0) -> Inbox:
        """Return a bounded queue of what is published on matching keys."""
        inbox = Inbox(depth)
        self.bus.subscribe(self, pattern, inbox, history)
        return inbox

    def announce(self, key: str) -> None:
        """Hold a liveliness token."""
        self.bus.announce(self, key)

    def presence(self, pattern: str) -> Presence:
        """Return the live set of matching tokens."""
        presence = Presence()
        self.bus.watch(self, pattern, presence)
        return presence

    def alive(self, pattern: str, timeout_s: float) -> list[str]:  # noqa: ARG002 - nothing waits here
        """Return the keys of the matching tokens at present."""
        return [key for key in self.bus.tokens() if matches(pattern, key)]

    def requests(self, pattern: str, depth: int) -> RequestInbox:
        """Return the requests made on matching keys."""
        requests = RequestInbox(depth)
        self.bus.answer(self, pattern, requests)
        return requests

    def ask(self, key: str, payload: bytes, timeout_s: float) -> bytes:  # noqa: ARG002 - nothing waits here
        """Raise RequestError: the answer comes with a later tick, which a single thread cannot wait for."""
        raise RequestError(f"{key}: use `post` on a bus in memory")

    def post(self, key: str, payload: bytes) -> list[tuple[bool, bytes]]:
        """Send a request without waiting: the answering tick fills the returned list with (answered, payload)."""
        answers: list[tuple[bool, bytes]] = []
        self.bus.ask(
            Request(key, payload, lambda data: answers.append((True, data)), lambda data: answers.append((False, data)))
        )
        return answers

    def close(self) -> None:
        """Leave the bus."""
        if not self.closed:
            self.closed = True
            self.bus.leave(self)
