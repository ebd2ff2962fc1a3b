"""Fleets with keys for tests, and sessions over mutual TLS on loopback."""

from threading import Event

from mpc_cover.clock import MonotonicClock
from mpc_cover.service.credentials.fleet_folder import write_fleet
from mpc_cover.service.credentials.folder import load_credentials
from mpc_cover.service.protocol.network import NetworkOptions
from mpc_cover.service.protocol.transport import open_transport

LOOPBACK = ("127.0.0.1", "localhost")


def make_fleet(folder, *, name="fleet", agents=("a1", "a2"), days=30.0, hosts=None):
    """Write the keys of a fleet; return its folder."""
    write_fleet(folder, name, agents, {"controller": LOOPBACK, "router": LOOPBACK, **(hosts or {})}, days)
    return folder


def warned(text):
    raise AssertionError(text)


def load(fleet, role):
    return load_credentials(fleet / role, warned)


def join(fleet, role, *, listen=(), connect=(), timeout_s=5.0, **options):
    """Return the transport of a role, over real TLS."""
    network = NetworkOptions(tuple(listen), tuple(connect), None, timeout_s, load(fleet, role), **options)
    return open_transport(network, MonotonicClock(), Event())
