"""A transport that signs all that it sends, and passes on only what is signed by whoever may say it.

A router, or a peer that has been taken over, can then delay messages, not make them. Who may say what follows from the
key: an agent what is below its id, but for its plan, which is the controller's, as is all that the controller says and
answers; commands are the operator's. Presence is not signed: liveliness tokens bear no payload.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from mpc_cover.service.credentials.roles import CONTROLLER, OPERATOR
from mpc_cover.service.credentials.signature import SIGNATURE_BYTES, SignatureError, is_signed, sign, verify
from mpc_cover.service.protocol.bus import RequestError
from mpc_cover.service.protocol.decoding import MAX_PAYLOAD, Reason, RejectedError
from mpc_cover.service.protocol.keys import ANY, agent_of, is_command
from mpc_cover.service.protocol.rate_limit import RateLimit

if TYPE_CHECKING:
    from mpc_cover.service.credentials.folder import Credentials
    from mpc_cover.service.protocol.bus import (
        Inbox,
        Presence,
        Publisher,
        Quality,
        Received,
        Request,
        RequestInbox,
        Transport,
    )

REPLY = " reply"
"""Added to the key of a request, for what its reply is signed."""


def author_of(key: str) -> str:
    """Return the role that publishes on a key, or may ask where it is that of a command."""
    if is_command(key):
        return OPERATOR
    agent = agent_of(key)
    return agent if agent and not key.endswith("/plan") else CONTROLLER


@dataclass(frozen=True)
class _SignedPublisher:
    inner: Publisher
    key: str
    credentials: Credentials

    def publish(self, payload: bytes) -> None:
        self.inner.publish(_signed(self.credentials, self.key, payload))


class SignedTransport:
    """The transport of somebody with credentials; see `bus.Transport`."""

    signed = True

    def __init__(self, inner: Transport, credentials: Credentials) -> None:
        self._inner, self._credentials = inner, credentials

    @property
    def callback_errors(self) -> int:
        """Number of exceptions in callbacks."""
        return self._inner.callback_errors

    def publisher(self, key: str, quality: Quality) -> Publisher:
        """Return the publisher of a key, which signs."""
        return _SignedPublisher(self._inner.publisher(key, quality), key, self._credentials)

    def inbox(self, pattern: str, depth: int, *, history: int = 0) -> Inbox:
        """Return a bounded queue of what is published on matching keys; who drains it gets what is genuine."""
        inbox = self._inner.inbox(pattern, depth, history=history)
        limit = RateLimit()
        shared = ANY in pattern

        def admit(item: Received) -> None:
            author = author_of(item.key)
            if author not in self._credentials.signers:
                raise RejectedError(Reason.FORGED, f"{author} is not of fleet {self._credentials.fleet}")
            if shared and not limit.allows(author, item.received_s):
                raise RejectedError(Reason.FLOOD, f"of {author}")

        inbox.admit, inbox.verify = admit, self._genuine
        return inbox

    def announce(self, key: str) -> None:
        """Hold a liveliness token."""
        self._inner.announce(key)

    def presence(self, pattern: str) -> Presence:
        """Return the live set of matching tokens."""
        return self._inner.presence(pattern)

    def alive(self, pattern: str, timeout_s: float) -> list[str]:
        """Return the keys of the matching tokens at present."""
        return self._inner.alive(pattern, timeout_s)

    def requests(self, pattern: str, depth: int) -> RequestInbox:
        """Return the requests made on matching keys: commands only those of the operator."""
        requests = self._inner.requests(pattern, depth)
        requests.verify = self._genuine_request
        return requests

    def ask(self, key: str, payload: bytes, timeout_s: float) -> bytes:
        """Send a request and wait for the first answer, which must be the controller's.

        Raises
        ------
        RequestError
            No answer in time, an error instead of one, or one of somebody else.
        """
        answer = self._inner.ask(key, _signed(self._credentials, key, payload), timeout_s)
        try:
            return verified(self._credentials, CONTROLLER, key + REPLY, answer)
        except RejectedError as error:
            raise RequestError(f"{key}: the answer is not the controller's: {error}") from None

    def close(self) -> None:
        """Leave the network."""
        self._inner.close()

    def _genuine(self, item: Received) -> Received:
        payload = verified(self._credentials, author_of(item.key), item.key, item.payload)
        return replace(item, payload=payload)

    def _genuine_request(self, request: Request) -> Request:
        payload = request.payload
        if is_command(request.key):
            payload = verified(self._credentials, OPERATOR, request.key, payload)

        def reply(data: bytes) -> None:
            request.reply(_signed(self._credentials, request.key + REPLY, data))

        return replace(request, payload=payload, reply=reply)


def verified(credentials: Credentials, role: str, topic: str, payload: bytes) -> bytes:
    """Return a message without its signature, which must be that of a role.

    Raises
    ------
    RejectedError
        It is too large, not signed, or by somebody else.
    """
    if len(payload) > MAX_PAYLOAD + SIGNATURE_BYTES:
        raise RejectedError(Reason.OVERSIZE, f"{len(payload)} bytes")
    key = credentials.signers.get(role)
    if key is None:
        raise RejectedError(Reason.FORGED, f"{role} is not of fleet {credentials.fleet}")
    try:
        return verify(key, topic, payload)
    except SignatureError:
        reason = Reason.FORGED if is_signed(payload) else Reason.UNSIGNED
        raise RejectedError(reason, f"must be signed by {role}") from None


def _signed(credentials: Credentials, topic: str, payload: bytes) -> bytes:
    """Return a message signed, where there is something to sign and a key to do it with."""
    if credentials.signing_key is None or not payload.endswith(b"}"):
        return payload
    return sign(credentials.signing_key, topic, payload)
