"""Configuration of the network: options as of every Zenoh tool, the settings they lead to, and errors about them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpc_cover.service.credentials.signature import SIGNATURE_BYTES
from mpc_cover.service.protocol.bus import TransportError
from mpc_cover.service.protocol.decoding import MAX_PAYLOAD
from mpc_cover.service.protocol.secure_network import TLS, check_scouting, check_secure, mode_of, secure_settings

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from mpc_cover.service.credentials.folder import Credentials

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
    """Endpoints such as `tcp/127.0.0.1:7474`, a Zenoh configuration file, and how long to wait for peers [s].

    With `credentials` all is encrypted, and everybody is who their certificate says. Without them only `insecure`
    allows endpoints that others than this machine may reach. `routes` is for who passes on messages of others.
    """

    listen: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()
    config: Path | None = None
    connect_timeout_s: float = 10.0
    credentials: Credentials | None = None
    insecure: bool = False
    routes: bool = False

    @property
    def where(self) -> str:
        """The endpoints, for users."""
        return ", ".join(self.listen + self.connect) or str(self.config)

    @property
    def mode(self) -> str:
        """The mode in which to take part, where no configuration says it."""
        return "router" if self.routes else mode_of(self.credentials, listens=bool(self.listen))


def default_endpoint(credentials: Credentials | None) -> str:
    """Return the endpoint for who gives none: encrypted where there are credentials."""
    return DEFAULT_ENDPOINT if credentials is None else DEFAULT_ENDPOINT.replace("tcp", TLS, 1)


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
    """Yield keys and JSON values: those always needed, and defaults of keys for which `configured` returns none.

    Raises
    ------
    TransportError
        An endpoint is malformed, or must not be used so.
    """
    for endpoint in (*options.listen, *options.connect):
        check_endpoint(endpoint)
    mode = json.loads(configured("mode")) or options.mode
    endpoints = {kind: _used(kind, options, configured, mode) for kind in ("listen", "connect")}
    for kind, each in endpoints.items():
        for endpoint in each:
            check_secure(endpoint, kind, options.credentials, insecure=options.insecure)
    check_scouting(json.loads(configured("scouting/multicast/enabled")), options.credentials, insecure=options.insecure)
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
    if options.credentials is not None:
        always |= secure_settings(options.credentials, listens=bool(endpoints["listen"]))
    unless_set: dict[str, tuple[object, object]] = {
        "mode": (None, mode),
        "scouting/multicast/enabled": (None, False),
        "scouting/delay": (None, 0),  # a router would wait half a second for others
        "scouting/gossip/enabled": (None, False),
        "connect/retry": (None, RETRY),
        "transport/link/tx/lease": (ZENOH_LEASE_MS, LEASE_MS),
        "transport/link/rx/max_message_size": (ZENOH_MAX_MESSAGE, MAX_MESSAGE),
        "low_pass_filter": ([], [_size_limit(options)]),
    }
    for key, value in always.items():
        yield key, json.dumps(value)
    for key, (unset, value) in unless_set.items():
        if json.loads(configured(key)) == unset:
            yield key, json.dumps(value)


def _used(kind: str, options: NetworkOptions, configured: Callable[[str], str], mode: str) -> list[str]:
    """Return the endpoints of a kind: those given, else those of the configuration for a mode."""
    given = options.listen if kind == "listen" else options.connect
    if given or not options.config:
        return list(given)
    found = json.loads(configured(f"{kind}/endpoints"))
    if isinstance(found, dict):  # Zenoh's own default, too: peers and routers listen on every interface
        found = found.get(mode)
    return [found] if isinstance(found, str) else list(found or [])


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
    right = "is the other side up, and -e/--connect right?"
    if options.credentials is not None:
        right = (
            f"is the other side up, of the same fleet {options.credentials.fleet}, with a certificate that has not"
            " expired and is for this address (`keys new --host`)?"
        )
    return f"network: cannot reach {where} within {waited}: {right}"


def _size_limit(options: NetworkOptions) -> dict[str, object]:
    """Return Zenoh's filter that drops payloads larger than any message of this protocol."""
    return {
        "id": "mpc-cover",
        "flows": ["ingress"],
        "messages": ["put", "query", "reply"],
        "key_exprs": ["cover/**"],
        "size_limit": MAX_PAYLOAD + (SIGNATURE_BYTES if options.credentials else 0),
    }
