"""The simulated network: the interface of `protocol.bus` on virtual time, through channels with faults."""

from __future__ import annotations

import hashlib
from collections import deque
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from mpc_cover.service.protocol.bus import Inbox, NoAnswerError, Presence, Quality, Received, RequestInbox
from mpc_cover.service.protocol.keys import matches
from mpc_cover.service.protocol.network import LEASE_MS
from mpc_cover.service.torture.channel import LATENCY_S

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.service.torture.channel import Channel
    from mpc_cover.service.torture.faults import Fault
    from mpc_cover.service.torture.processes import Process
    from mpc_cover.service.torture.virtual_time import VirtualTime

LEASE_S = LEASE_MS / 1000.0
"""After so long without a sign of life the others hold a process's tokens for lost [s]."""
_TRACED = ("/state", "/plan")
"""Ends of the keys whose payloads belong to the trace; others hold durations of the computing machine."""


@dataclass(eq=False)
class _Subscription:
    owner: SimulatedTransport
    pattern: str
    inbox: Inbox


@dataclass(eq=False)
class _Watch:
    owner: SimulatedTransport
    pattern: str
    presence: Presence


class SimulatedNetwork:
    """Carries what processes publish to those that subscribed.

    Attributes
    ----------
    lost : messages that never arrived.
    stopped_lose : processes to which messages are lost while they are stopped, instead of waiting for them.
    rewrite : changes payloads as they are sent, from a process's name, key and payload.
    """

    def __init__(self, time: VirtualTime, channel: Channel) -> None:
        self.time, self.channel = time, channel
        self.lost = self.delivered = 0
        self.stopped_lose: set[Process] = set()
        self.rewrite: Callable[[str, str, bytes], bytes] = lambda name, key, payload: payload  # noqa: ARG005
        self._trace = hashlib.sha256()
        self._transports: list[SimulatedTransport] = []
        self._subscriptions: list[_Subscription] = []
        self._watches: list[_Watch] = []

    @property
    def digest(self) -> str:
        """A fingerprint of all that was sent, and of when it arrived."""
        return self._trace.hexdigest()

    def join(self, process: Process) -> SimulatedTransport:
        """Return a process's access to the network, which ends with it."""
        transport = SimulatedTransport(self, process)
        self._transports.append(transport)
        process.on_end.append(transport.close)
        return transport

    def of(self, process: Process) -> list[SimulatedTransport]:
        """Return a process's accesses to the network."""
        return [transport for transport in self._transports if transport.process is process]

    def send(self, source: SimulatedTransport, key: str, payload: bytes, quality: Quality) -> None:
        """Let a message travel to all that subscribed to its key."""
        payload = self.rewrite(source.name, key, payload)
        if quality.history:
            source.history.setdefault(key, deque(maxlen=quality.history)).append(payload)
        self._note("sent", source.name, key, payload)
        for subscription in list(self._subscriptions):
            if matches(subscription.pattern, key):
                self._carry(source, subscription, key, payload)

    def subscribe(self, owner: SimulatedTransport, pattern: str, inbox: Inbox, history: int) -> None:
        """Add an inbox, with what those who can be reached have kept of the past."""
        subscription = _Subscription(owner, pattern, inbox)
        self._subscriptions.append(subscription)
        for source in self._transports if history else ():
            for key, past in source.history.items():
                if matches(pattern, key) and source is not owner:
                    for payload in list(past)[-history:]:
                        self._carry(source, subscription, key, payload)

    def announce(self, owner: SimulatedTransport, key: str) -> None:
        """Let a liveliness token appear for all that can be reached."""
        if key in owner.tokens:
            return
        owner.tokens.append(key)
        for watch in self._watches:
            if matches(watch.pattern, key):
                self._show(owner, watch, key)

    def watch(self, owner: SimulatedTransport, pattern: str, presence: Presence) -> None:
        """Keep a presence up to date."""
        watch = _Watch(owner, pattern, presence)
        self._watches.append(watch)
        for transport in self._transports:
            for key in transport.tokens:
                if matches(pattern, key):
                    self._show(transport, watch, key)

    def seen(self, owner: SimulatedTransport, pattern: str) -> list[str]:
        """Return the keys of the tokens that a process could see now."""
        return [
            key
            for transport in self._transports
            for key in transport.tokens
            if matches(pattern, key) and self._parting(transport, owner) is None
        ]

    def leave(self, owner: SimulatedTransport) -> None:
        """Remove a process that has ended: its tokens are gone at once for all that are connected to it."""
        self._subscriptions = [each for each in self._subscriptions if each.owner is not owner]
        self._watches = [each for each in self._watches if each.owner is not owner]
        self._transports.remove(owner)
        gone, owner.tokens = owner.tokens, []
        for key in gone:
            for watch in self._watches:
                if matches(watch.pattern, key):
                    heard = self._parting(owner, watch.owner) is None and not owner.process.stopped
                    later_s = LATENCY_S if heard else LEASE_S
                    self._set_later(watch, key, alive=False, after_s=later_s)

    def begin_silence(self, names: tuple[str, ...]) -> None:
        """Let the tokens of processes that have fallen silent, and of all others for them, be lost with the lease."""
        for transport, watch, key in self._across(names):
            self.time.at(self.time.now_s + LEASE_S, partial(self._expire, transport, watch, key))

    def end_silence(self, names: tuple[str, ...]) -> None:
        """Let tokens appear again between processes that reach each other again."""
        for transport, watch, key in self._across(names):
            self._show(transport, watch, key)

    def _across(self, names: tuple[str, ...]) -> list[tuple[SimulatedTransport, _Watch, str]]:
        return [
            (transport, watch, key)
            for transport in self._transports
            for key in transport.tokens
            for watch in self._watches
            if matches(watch.pattern, key) and (transport.name in names) != (watch.owner.name in names)
        ]

    def _expire(self, transport: SimulatedTransport, watch: _Watch, key: str) -> None:
        parting = self._parting(transport, watch.owner)
        silent = transport.process.stopped or watch.owner.process.stopped
        if (parting is not None and not parting.keeps_token) or silent:
            self._set(watch, key, alive=False)

    def _show(self, transport: SimulatedTransport, watch: _Watch, key: str) -> None:
        if self._parting(transport, watch.owner) is None:
            self._set_later(watch, key, alive=True, after_s=LATENCY_S)

    def _set_later(self, watch: _Watch, key: str, *, alive: bool, after_s: float) -> None:
        self.time.at(self.time.now_s + after_s, partial(self._set, watch, key, alive=alive))

    def _set(self, watch: _Watch, key: str, *, alive: bool) -> None:
        if watch.owner.process.alive:
            watch.owner.process.when_running(partial(self._put_token, watch, key, alive=alive))

    def _put_token(self, watch: _Watch, key: str, *, alive: bool) -> None:
        if alive and not any(key in transport.tokens for transport in self._transports):
            return  # it has gone meanwhile
        watch.presence.set(key, alive, watch.owner.process.clock.now())

    def _parting(self, one: SimulatedTransport, other: SimulatedTransport) -> Fault | None:
        return self.channel.cut_off(one.name, other.name, self.time.now_s)

    def _carry(self, source: SimulatedTransport, target: _Subscription, key: str, payload: bytes) -> None:
        arrivals = self.channel.arrivals(source.name, target.owner.name, key, self.time.now_s)
        self.lost += not arrivals
        for arrival_s in arrivals:
            self.time.at(arrival_s, partial(self._arrive, target, key, payload))

    def _arrive(self, target: _Subscription, key: str, payload: bytes) -> None:
        process = target.owner.process
        if not process.alive or (process.stopped and process in self.stopped_lose):
            self.lost += 1
            return
        self._note("arrived", process.name, key, payload)
        process.when_running(partial(self._put, target, key, payload))

    def _put(self, target: _Subscription, key: str, payload: bytes) -> None:
        self.delivered += 1
        target.inbox.put(Received(key, payload, target.owner.process.clock.now()))

    def _note(self, what: str, name: str, key: str, payload: bytes) -> None:
        content = payload if key.endswith(_TRACED) else b""
        self._trace.update(f"{self.time.now_s!r} {what} {name} {key} ".encode() + content + b"\n")


@dataclass(frozen=True)
class _SimulatedPublisher:
    transport: SimulatedTransport
    key: str
    quality: Quality

    def publish(self, payload: bytes) -> None:
        self.transport.publish(self.key, payload, self.quality)


class SimulatedTransport:
    """One process's access to the network; see `bus.Transport`.

    Attributes
    ----------
    history : what it keeps of what it published, by key.
    tokens : its liveliness tokens.
    dies_after : the process dies after so many more plans; None for never.
    """

    signed = False

    def __init__(self, network: SimulatedNetwork, process: Process) -> None:
        self.network, self.process, self.name = network, process, process.name
        self.closed = False
        self.history: dict[str, deque[bytes]] = {}
        self.tokens: list[str] = []
        self.dies_after: int | None = None

    @property
    def callback_errors(self) -> int:
        """There are no callbacks here."""
        return 0

    def publish(self, key: str, payload: bytes, quality: Quality) -> None:
        """Send a message; the process may be one that dies after it."""
        self.process.check_alive()
        if self.closed:
            return
        self.network.send(self, key, payload, quality)
        if self.dies_after is not None and key.endswith("/plan"):
            self.dies_after -= 1
            if self.dies_after <= 0:
                self.process.die()

    def publisher(self, key: str, quality: Quality) -> _SimulatedPublisher:
        """Return the publisher of a key."""
        return _SimulatedPublisher(self, key, quality)

    def inbox(self, pattern: str, depth: int, *, history: int = 0) -> Inbox:
        """Return a bounded queue of what is published on matching keys."""
        inbox = Inbox(depth)
        self.network.subscribe(self, pattern, inbox, history)
        return inbox

    def announce(self, key: str) -> None:
        """Hold a liveliness token."""
        self.network.announce(self, key)

    def presence(self, pattern: str) -> Presence:
        """Return the live set of matching tokens."""
        presence = Presence()
        self.network.watch(self, pattern, presence)
        return presence

    def alive(self, pattern: str, timeout_s: float) -> list[str]:  # noqa: ARG002 - nothing waits here
        """Return the keys of the matching tokens at present."""
        return self.network.seen(self, pattern)

    def requests(self, pattern: str, depth: int) -> RequestInbox:  # noqa: ARG002 - nobody asks in this world
        """Return an inbox of requests, of which there are none."""
        return RequestInbox(depth)

    def ask(self, key: str, payload: bytes, timeout_s: float) -> bytes:  # noqa: ARG002 - nobody answers in this world
        """Raise NoAnswerError: nobody answers."""
        raise NoAnswerError(f"{key}: nobody answers in this world")

    def close(self) -> None:
        """Leave the network."""
        if not self.closed:
            self.closed = True
            self.network.leave(self)
