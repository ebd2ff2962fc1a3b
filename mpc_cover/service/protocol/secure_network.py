"""What a network must be like that others than this machine can reach: credentials, and all that follows from them."""

from __future__ import annotations

import ipaddress
from typing import TYPE_CHECKING

from mpc_cover.service.credentials import roles
from mpc_cover.service.protocol.access import access_control
from mpc_cover.service.protocol.bus import TransportError

if TYPE_CHECKING:
    from mpc_cover.service.credentials.folder import Credentials

TLS = "tls"
"""The protocol of all endpoints where there are credentials."""
LOCAL_PROTOCOLS = {"unixsock-stream", "unixpipe"}
"""Those that never leave the machine."""
ASKED_FOR = "give --credentials DIR, or --insecure if that is wanted"
_OF_TLS = ("mtls", "certificate", "private_key", "verify_name")
"""What an endpoint's own settings would take from the credentials."""


def mode_of(credentials: Credentials | None, *, listens: bool) -> str:
    """Return the mode in which to take part.

    Peers pass nothing on, and trust each other. With credentials there is somebody in the middle who enforces who may
    say what: a router, or the controller where it listens itself; all others are its clients. Agents that listen are
    those of the potential law: each enforces it for itself.
    """
    if credentials is None or (listens and credentials.role not in roles.SERVICE_ROLES):
        return "peer"
    return "router" if listens else "client"


def secure_settings(credentials: Credentials, *, listens: bool) -> dict[str, object]:
    """Return mutual TLS, and nothing but it; and who listens denies whatever is not allowed.

    Who only connects has to do with nobody but the one who does that.
    """
    folder = credentials.folder
    certificate, key = str(folder / roles.CERTIFICATE_FILE), str(folder / roles.KEY_FILE)
    tls = {
        "root_ca_certificate": str(folder / roles.CA_FILE),
        "enable_mtls": True,
        "listen_certificate": certificate,
        "listen_private_key": key,
        "connect_certificate": certificate,
        "connect_private_key": key,
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
    }
    found: dict[str, object] = {
        "transport/link/tls": tls,
        "transport/link/protocols": [TLS],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
    }
    if listens:
        found["access_control"] = access_control(credentials.agents)
    return found


def check_secure(endpoint: str, kind: str, credentials: Credentials | None, *, insecure: bool) -> None:
    """Check that an endpoint to `listen` on, or to `connect` to, is one that strangers cannot use.

    Raises
    ------
    TransportError
        It is not as the credentials ask for; or others may reach it, and there are none.
    """
    if credentials is not None:
        _check_tls(endpoint, kind, credentials)
    elif not (insecure or is_local(endpoint)):
        text = "another machine can listen in, and steer the fleet" if kind == "listen" else "leads to another machine"
        where = f"endpoint {endpoint!r} to {kind} {'on' if kind == 'listen' else 'to'}"
        raise TransportError(f"{where}: {text}: {ASKED_FOR}")


def check_scouting(multicast: object, credentials: Credentials | None, *, insecure: bool) -> None:
    """Raise TransportError where multicast would find whoever is on the network."""
    if multicast and credentials is None and not insecure:
        raise TransportError(f"network configuration: scouting by multicast finds other machines: {ASKED_FOR}")


def is_local(endpoint: str) -> bool:
    """Return whether an endpoint can be reached from this machine alone."""
    protocol, _, address = endpoint.partition("/")
    if protocol in LOCAL_PROTOCOLS:
        return True
    host = address.partition("?")[0].partition("#")[0].rpartition(":")[0].strip("[]")
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _check_tls(endpoint: str, kind: str, credentials: Credentials) -> None:
    protocol, _, address = endpoint.partition("/")
    if protocol != TLS:
        raise TransportError(f"endpoint {endpoint!r}: with --credentials it must be {TLS}/{address}")
    if any(word in address.partition("#")[2] for word in _OF_TLS):
        raise TransportError(f"endpoint {endpoint!r}: must leave to --credentials what it says of certificates")
    if kind == "listen" and not credentials.hosts:
        text = f"the certificate of {credentials.role} is for no address"
        right = f"make keys with `--host {credentials.role}=ADDRESS` for it, or let it connect to a router by -e"
        raise TransportError(f"endpoint {endpoint!r} to listen on: {text}: {right}")
