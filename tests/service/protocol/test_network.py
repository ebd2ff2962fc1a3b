"""Which words name an endpoint of the network."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from mpc_cover.service.protocol.bus import TransportError
from mpc_cover.service.protocol.network import NetworkOptions, check_endpoint, settings


@pytest.mark.parametrize(
    "endpoint", ["", "tcp", "tcp/", "tcp/:1", "tcp/host", "tcp/host:port", "tcp/host:70000", "127.0.0.1:7474"]
)
def test_what_is_no_endpoint_is_told(endpoint):
    with pytest.raises(TransportError, match="must look like tcp/127"):
        check_endpoint(endpoint)


@pytest.mark.parametrize(
    "endpoint", ["tcp/127.0.0.1:7474", "tcp/[::1]:7474", "tls/host.example:1?so_rcvbuf=1", "unixsock-stream/x"]
)
def test_what_is_an_endpoint(endpoint):
    assert check_endpoint(endpoint) == endpoint


def configured(**keys):
    """Return what reads a configuration as Zenoh would, with its own defaults."""
    defaults = {"listen/endpoints": {"router": ["tcp/[::]:7447"], "peer": ["tcp/[::]:0"]}, "connect/endpoints": []}
    return lambda key: json.dumps({**defaults, "low_pass_filter": [], **keys}.get(key))


FILE = Path("zenoh.json5")


def test_a_client_listens_nowhere_and_needs_no_credentials_for_it():
    options = NetworkOptions(connect=("tcp/127.0.0.1:1",), config=FILE)
    assert dict(settings(options, configured(mode="client"), 500))["connect/endpoints"] == '["tcp/127.0.0.1:1"]'
    with pytest.raises(TransportError, match="another machine can listen in"):
        list(settings(options, configured(mode="peer"), 500))
    assert list(settings(replace(options, insecure=True), configured(mode="peer"), 500))
