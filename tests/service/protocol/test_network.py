"""Which words name an endpoint of the network."""

import pytest

from mpc_cover.service.protocol.bus import TransportError
from mpc_cover.service.protocol.network import check_endpoint


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
