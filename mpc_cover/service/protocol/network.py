"""Configuration of the network: options as of every Zenoh tool, the settings they lead to, and errors about them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpc_cover.service.protocol.bus import TransportError
from mpc_cover.service.protocol.decoding import MAX_PAYLOAD

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7474"
"""Where `serve` listens and `agent` connects by default."""
ZENOH_LEASE_MS = 10_000
LEASE_MS = 1000
"""A hung process counts as lost after this."""
ZENOH_MAX_MESSAGE = 1 << 30
MAX_MESSAGE = 4 << 20
"""Zenoh's own default is 1 GiB, which any peer could make us allocate [bytes]."""
RETRY = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5}


@dataclass(frozen=True)
class NetworkOptions:
    """Endpoints such as `tcp/127.0.0.1:7474`, a Zenoh configuration file, and how long to wait for peers [s]."""

    listen: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()
    config: Path | None = None
    connect_timeout_s: float = 10.0


def check_endpoint(endpoint: str) -> str:
    """Return the endpoint.

    Raises
    ------
    TransportError
        It is malformed: Zenoh itself would wait for it without an error.
    """
    protocol, _, address = endpoint.partition("/")
    host, _, port = address.partition("?")[0].partition("#")[0].rpartition(":")
    named = protocol in ("tcp", "udp", "tls", "quic", "ws")
    if not protocol or not address or (named and not (host and port.isdigit() and 0 <= int(port) <= 65535)):  # noqa: PLR2004
        raise TransportError(f"endpoint {endpoint!r}: must look like {DEFAULT_ENDPOINT}")
    return endpoint


def settings(options: NetworkOptions, configured: Callable[[str], str], attempt_ms: int) -> Iterator[tuple[str, str]]:
    """Yield keys and JSON values: those always needed, and defaults of keys for which `configured` returns none."""
    for endpoint in (*options.listen, *options.connect):
        check_endpoint(endpoint)
    always: dict[str, object] = {
        "timestamping/enabled": True,  # AdvancedPublisher needs it
        "transport/shared_memory/enabled": False,  # leaves segments behind after SIGKILL
        "connect/timeout_ms": attempt_ms,
        "connect/exit_on_failure": True,
        "listen/timeout_ms": 0,
        "listen/exit_on_failure": True,
    }
    if options.listen or not options.config:
        always["listen/endpoints"] = list(options.listen)
    if options.connect or not options.config:
        always["connect/endpoints"] = list(options.connect)
    unless_set: dict[str, tuple[object, object]] = {
        "mode": (None, "peer"),
        "scouting/multicast/enabled": (None, False),
        "scouting/gossip/enabled": (None, False),
        "connect/retry": (None, RETRY),
        "transport/link/tx/lease": (ZENOH_LEASE_MS, LEASE_MS),
        "transport/link/rx/max_message_size": (ZENOH_MAX_MESSAGE, MAX_MESSAGE),
        "low_pass_filter": ([], [_size_limit()]),
    }
    for key, value in always.items():
        yield key, json.dumps(value)
    for key, (unset, value) in unless_set.items():
        if json.loads(configured(key)) == unset:
            yield key, json.dumps(value)


def cannot_listen(options: NetworkOptions, text: str) -> str:
    """Return the error message for endpoints that cannot be listened on, because of `text`."""
    where = ", ".join(options.listen) or "the configured endpoints"
    if "already in use" in text:
        return f"network: cannot listen on {where}: the port is in use: choose another one with -l/--listen"
    return f"network: cannot listen on {where}: {text}"


def cannot_connect(options: NetworkOptions) -> str:
    """Return the error message for endpoints that stay unreachable."""
    where = ", ".join(options.connect) or "the configured endpoints"
    waited = f"{options.connect_timeout_s:g} s"
    return f"network: cannot reach {where} within {waited}: is the other side up, and -e/--connect right?"


def _size_limit() -> dict[str, object]:
    """Return Zenoh's filter that drops payloads larger than any message of this protocol."""
    return {
        "id": "mpc-cover",
        "flows": ["ingress"],
        "messages": ["put", "query", "reply"],
        "key_exprs": ["cover/**"],
        "size_limit": MAX_PAYLOAD,
    }
