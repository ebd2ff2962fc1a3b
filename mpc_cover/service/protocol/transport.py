"""The transport over Zenoh, the only file that imports zenoh.

Pitfalls of Zenoh are handled here: no operation in the control loop blocks, callbacks only fill bounded queues
and count their exceptions, liveliness tokens are kept alive, multicast, gossip and shared memory are off, and an
endpoint that is in use or unreachable is one clear error.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from threading import Event
from typing import TYPE_CHECKING, Any

import zenoh

from mpc_cover.service.protocol.bus import (
    Inbox,
    NoAnswerError,
    Presence,
    Quality,
    Received,
    Request,
    RequestError,
    RequestInbox,
    TransportError,
    UnreachableError,
)
from mpc_cover.service.protocol.network import NetworkOptions, cannot_connect, cannot_listen, settings
from mpc_cover.service.protocol.signed_transport import SignedTransport

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.clock import Clock
    from mpc_cover.service.protocol.bus import Transport

ATTEMPT_MS = 500
"""Duration of one attempt to connect; signals are handled between attempts."""
JSON = "application/json"


def open_transport(options: NetworkOptions, clock: Clock, stop: Event) -> Transport:
    """Join the network, waiting for unreachable endpoints up to `options.connect_timeout_s`.

    With credentials, what is sent is signed, and what comes is verified.

    Raises
    ------
    UnreachableError
        An endpoint stays unreachable.
    TransportError
        A port in use, a malformed endpoint, a bad configuration file.
    InterruptedError
        `stop` was set meanwhile.
    """
    transport = _open(options, clock, stop)
    return transport if options.credentials is None else SignedTransport(transport, options.credentials)


def _open(options: NetworkOptions, clock: Clock, stop: Event) -> ZenohTransport:
    config = _configure(options)
    deadline = time.monotonic() + options.connect_timeout_s
    while True:
        try:
            return ZenohTransport(zenoh.open(config), clock)
        except zenoh.ZError as error:
            text = _plain(error)
            if "Unable to connect" not in text:
                raise TransportError(cannot_listen(options, text)) from None
            if time.monotonic() >= deadline:
                raise UnreachableError(cannot_connect(options)) from None
        if stop.is_set():
            raise InterruptedError


def _configure(options: NetworkOptions) -> zenoh.Config:
    try:
        config = zenoh.Config.from_file(str(options.config)) if options.config else zenoh.Config()
    except zenoh.ZError as error:
        raise TransportError(f"network configuration {options.config}: cannot be used: {_plain(error)}") from None
    for key, value in settings(options, config.get_json, ATTEMPT_MS):
        try:
            config.insert_json5(key, value)
        except zenoh.ZError as error:
            raise TransportError(f"network: {key} {value} cannot be used: {_plain(error)}") from None
    return config


def _plain(error: zenoh.ZError) -> str:
    """Return Zenoh's error message without its source lines."""
    text = " ".join(str(error).split())
    return text.split(" at /", 1)[0].replace("[", "").strip()


_TIMED_OUT = "Timeout"
"""Zenoh's own reply to a query that was received and not answered in time."""
_RETRY_S = 0.05
"""Pause before a request that reached no receiver is sent again."""


@dataclass(frozen=True)
class _ZenohPublisher:
    publisher: Any  # zenoh.Publisher or zenoh.ext.AdvancedPublisher
    transport: ZenohTransport

    def publish(self, payload: bytes) -> None:
        if not self.transport.closed:
            self.publisher.put(payload)


class ZenohTransport:
    """One Zenoh session; see `bus.Transport`."""

    signed = False

    def __init__(self, session: zenoh.Session, clock: Clock) -> None:
        self._session = session
        self._clock = clock
        self._kept: list[Any] = []  # tokens and subscribers undeclare themselves when collected
        self.callback_errors = 0
        self.closed = False

    def publisher(self, key: str, quality: Quality) -> _ZenohPublisher:
        """Return the publisher of a key; it drops rather than blocks."""
        priority = getattr(zenoh.Priority, quality.priority)
        drop = zenoh.CongestionControl.DROP
        if quality.history:
            advanced = zenoh.ext.declare_advanced_publisher(
                self._session,
                key,
                encoding=JSON,
                congestion_control=drop,
                priority=priority,
                cache=zenoh.ext.CacheConfig(quality.history),
                publisher_detection=True,
            )
            return _ZenohPublisher(advanced, self)
        plain = self._session.declare_publisher(key, encoding=JSON, congestion_control=drop, priority=priority)
        return _ZenohPublisher(plain, self)

    def inbox(self, pattern: str, depth: int, *, history: int = 0) -> Inbox:
        """Return a bounded queue of what is published on matching keys."""
        inbox = Inbox(depth)

        def put(sample: zenoh.Sample) -> None:
            inbox.put(Received(str(sample.key_expr), sample.payload.to_bytes(), self._clock.now()))

        if history:
            past = zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=history)
            subscriber: Any = zenoh.ext.declare_advanced_subscriber(
                self._session, pattern, self._counted(put), history=past
            )
        else:
            subscriber = self._session.declare_subscriber(pattern, self._counted(put))
        self._kept.append(subscriber)
        return inbox

    def announce(self, key: str) -> None:
        """Hold a liveliness token."""
        self._kept.append(self._session.liveliness().declare_token(key))

    def presence(self, pattern: str) -> Presence:
        """Return the live set of matching tokens."""
        presence = Presence()

        def note(sample: zenoh.Sample) -> None:
            presence.set(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT, self._clock.now())

        liveliness = self._session.liveliness()
        self._kept.append(liveliness.declare_subscriber(pattern, self._counted(note), history=True))
        return presence

    def alive(self, pattern: str, timeout_s: float) -> list[str]:
        """Return the keys of the matching tokens at present, asking for them at most so long."""
        replies = self._session.liveliness().get(pattern, timeout=timeout_s)
        return [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]

    def requests(self, pattern: str, depth: int) -> RequestInbox:
        """Return the requests made on matching keys."""
        requests = RequestInbox(depth)

        def put(query: zenoh.Query) -> None:
            payload = query.payload.to_bytes() if query.payload else b""
            key = str(query.key_expr)

            def reply(data: bytes) -> None:
                self._answer(lambda: query.reply(key, data, encoding=JSON), query)

            def fail(data: bytes) -> None:
                self._answer(lambda: query.reply_err(data), query)

            requests.put(Request(key, payload, reply, fail))

        self._kept.append(self._session.declare_queryable(pattern, self._counted(put)))
        return requests

    def ask(self, key: str, payload: bytes, timeout_s: float) -> bytes:
        """Send a request and wait for the first answer.

        A query ends at once where no queryable is known yet, and declarations take a while to propagate: it is
        repeated until the time is over.

        Raises
        ------
        NoAnswerError
            No answer in time.
        RequestError
            An error instead of an answer.
        """
        deadline, pause = time.monotonic() + timeout_s, Event()
        while (left_s := deadline - time.monotonic()) > 0.0:
            for reply in self._session.get(key, payload=payload, timeout=left_s):
                if reply.ok is not None:
                    return bytes(reply.ok.payload.to_bytes())
                text = reply.err.payload.to_bytes().decode(errors="replace") if reply.err else "error"
                if text == _TIMED_OUT:
                    break
                raise RequestError(f"{key}: {text}")
            pause.wait(min(_RETRY_S, left_s))
        raise NoAnswerError(f"{key}: no answer within {timeout_s:g} s")

    def close(self) -> None:
        """Leave the network; may be called twice.

        Must be called: the threads of Zenoh's callbacks would keep the process alive. A peer that hangs with a
        full queue delays it by Zenoh's own ten seconds.
        """
        if self.closed:
            return
        self.closed = True
        self._kept.clear()
        try:
            self._session.close()  # type: ignore[no-untyped-call]
        except zenoh.ZError:
            self.callback_errors += 1

    def _counted(self, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return the callback with its exceptions counted: Zenoh would print and suppress them."""

        def guarded(item: object) -> None:
            try:
                callback(item)
            except Exception:  # noqa: BLE001 - a fault that the status reports as a count
                self.callback_errors += 1

        return guarded

    def _answer(self, send: Callable[[], None], query: zenoh.Query) -> None:
        try:
            send()
        except zenoh.ZError:  # the requester has left
            self.callback_errors += 1
        finally:
            query.drop()  # type: ignore[no-untyped-call]
