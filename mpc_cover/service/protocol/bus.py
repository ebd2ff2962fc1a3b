"""The interface of a network: `transport.py` implements it with Zenoh, `local.py` in memory."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from threading import Lock
from typing import TYPE_CHECKING, Protocol, TypeVar

from mpc_cover.errors import UserError
from mpc_cover.service.protocol.decoding import RejectedError

if TYPE_CHECKING:
    from collections.abc import Callable


class TransportError(UserError):
    """The network cannot be used as asked: a port in use, an unreachable endpoint, a bad configuration."""


class UnreachableError(TransportError):
    """No peer answers at the endpoint to connect to."""


class RequestError(Exception):
    """A request without an answer, or answered with an error."""


class NoAnswerError(RequestError):
    """A request without an answer in time."""


@dataclass(frozen=True)
class Quality:
    """Quality of service of a key; publishing never blocks.

    `priority` is the name of Zenoh's; `history` is how many samples late joiners receive.
    """

    priority: str
    history: int = 0


STATE = Quality("INTERACTIVE_HIGH", history=600)
"""With a minute of history: a controller that takes over after a crash learns what was measured meanwhile."""
PLAN = Quality("INTERACTIVE_HIGH", history=1)
STATUS = Quality("DATA", history=1)
MAP = Quality("DATA_LOW", history=1)
EVENT = Quality("DATA_HIGH", history=1000)


@dataclass(frozen=True)
class Received:
    """A received payload; `received_s` is the time of reception by the receiver's own clock [s]."""

    key: str
    payload: bytes
    received_s: float


class Inbox:
    """A bounded queue that a callback fills and a tick empties; when full, the oldest item is dropped.

    `verify`, where there is one, returns an item without its signature, or raises RejectedError: those are turned away
    before anybody looks at them. It is called by who empties the queue, so that a flood costs no more than its depth.
    `admit` may raise RejectedError, too: it is asked at once, so that nobody's flood takes up the room of others.
    """

    def __init__(self, depth: int) -> None:
        self._items: deque[Received] = deque(maxlen=depth)
        self._refused: deque[RejectedError] = deque(maxlen=depth)
        self.verify: Callable[[Received], Received] | None = None
        self.admit: Callable[[Received], None] | None = None
        self.dropped = 0

    def put(self, item: Received) -> None:
        """Add a received payload."""
        if self.admit is not None:
            try:
                self.admit(item)
            except RejectedError as error:
                self._refused.append(error)
                return
        if len(self._items) == self._items.maxlen:
            self.dropped += 1
        self._items.append(item)

    def drain(self) -> list[Received]:
        """Return everything received since last time that is genuine, oldest first."""
        items = _taken(self._items)
        return items if self.verify is None else _genuine(items, self.verify, self._refused)

    def take_refused(self) -> list[RejectedError]:
        """Return why items were turned away since last time."""
        return _taken(self._refused)


class Presence:
    """The liveliness tokens that are alive, and when others were lost."""

    def __init__(self) -> None:
        self._alive: set[str] = set()
        self._lost_s: dict[str, float] = {}
        self._lock = Lock()

    def set(self, key: str, alive: bool, time_s: float) -> None:
        """Note that a token appeared or was lost, at a time of the receiver's own clock [s]."""
        with self._lock:
            if alive:
                self._alive.add(key)
            elif key in self._alive:
                self._alive.discard(key)
                self._lost_s[key] = time_s

    def lost_s(self, key: str) -> float:
        """Return when a token was lost last [s]; -inf when it never was."""
        with self._lock:
            return self._lost_s.get(key, -math.inf)

    def alive(self) -> frozenset[str]:
        """Return the keys of the tokens that are alive."""
        with self._lock:
            return frozenset(self._alive)


@dataclass(frozen=True)
class Request:
    """A query to be answered within the next tick: with a reply, or an error."""

    key: str
    payload: bytes
    reply: Callable[[bytes], None]
    fail: Callable[[bytes], None]


class RequestInbox:
    """Requests that wait for the next tick; when full, the oldest remains unanswered.

    `verify` is as of an `Inbox`; who made a request that is turned away is told so.
    """

    def __init__(self, depth: int) -> None:
        self._items: deque[Request] = deque(maxlen=depth)
        self._genuine: deque[Request] = deque(maxlen=depth)
        self._refused: deque[RejectedError] = deque(maxlen=depth)
        self.verify: Callable[[Request], Request] | None = None

    def put(self, request: Request) -> None:
        """Add a request."""
        self._items.append(request)

    def keys(self) -> list[str]:
        """Return the keys of those that wait and are genuine, oldest first."""
        self._sort_out()
        return [request.key for request in self._genuine]

    def drain(self) -> list[Request]:
        """Return the requests since last time that are genuine, oldest first."""
        self._sort_out()
        return _taken(self._genuine)

    def take_refused(self) -> list[RejectedError]:
        """Return why requests were turned away since last time."""
        return _taken(self._refused)

    def _sort_out(self) -> None:
        for request in _taken(self._items):
            try:
                self._genuine.append(request if self.verify is None else self.verify(request))
            except RejectedError as error:
                self._refused.append(error)
                request.fail(str(error).encode())


T = TypeVar("T")


def _taken(items: deque[T]) -> list[T]:
    """Return what is in a queue that a callback may fill meanwhile, and empty it."""
    taken = []
    while items:
        taken.append(items.popleft())
    return taken


def _genuine(
    items: list[Received], verify: Callable[[Received], Received], refused: deque[RejectedError]
) -> list[Received]:
    genuine = []
    for item in items:
        try:
            genuine.append(verify(item))
        except RejectedError as error:
            refused.append(error)
    return genuine


class Publisher(Protocol):
    """Publishes on one key."""

    def publish(self, payload: bytes) -> None:
        """Send without ever waiting for a receiver."""
        ...


class Transport(Protocol):
    """One participant's view of the network."""

    @property
    def signed(self) -> bool:
        """Whether all that comes in is signed by whoever may say it."""
        ...

    @property
    def callback_errors(self) -> int:
        """Number of exceptions in callbacks, which the network library would suppress."""
        ...

    def publisher(self, key: str, quality: Quality) -> Publisher:
        """Return the publisher of a key."""
        ...

    def inbox(self, pattern: str, depth: int, *, history: int = 0) -> Inbox:
        """Return a bounded queue of what is published on matching keys, up to `history` past samples of each too."""
        ...

    def announce(self, key: str) -> None:
        """Hold a liveliness token until the transport is closed or the process dies."""
        ...

    def presence(self, pattern: str) -> Presence:
        """Return the live set of matching liveliness tokens."""
        ...

    def alive(self, pattern: str, timeout_s: float) -> list[str]:
        """Return the keys of the matching liveliness tokens at present, asking for them at most so long."""
        ...

    def requests(self, pattern: str, depth: int) -> RequestInbox:
        """Return the requests made on matching keys."""
        ...

    def ask(self, key: str, payload: bytes, timeout_s: float) -> bytes:
        """Send a request and wait for the first answer.

        Raises
        ------
        NoAnswerError
            No answer in time.
        RequestError
            An error instead of an answer.
        """
        ...

    def close(self) -> None:
        """Leave the network; may be called twice."""
        ...
