"""Which endpoints others than this machine can reach, and what credentials make of the network."""

import pytest
from fleet_keys import load, make_fleet

from mpc_cover.service.protocol.secure_network import is_local, mode_of, secure_settings


@pytest.mark.parametrize(
    "endpoint",
    ["tcp/127.0.0.1:1", "tcp/127.8.8.8:1", "tcp/[::1]:1", "udp/localhost:1?so_rcvbuf=1", "unixsock-stream//tmp/x"],
)
def test_what_only_this_machine_reaches(endpoint):
    assert is_local(endpoint)


@pytest.mark.parametrize(
    "endpoint",
    ["tcp/0.0.0.0:1", "tcp/[::]:1", "tcp/10.0.0.1:1", "tcp/localhost.example:1", "tcp/127.0.0.1.example:1", "serial/x"],
)
def test_what_others_may_reach(endpoint):
    assert not is_local(endpoint)


@pytest.mark.parametrize(
    ("role", "listens", "mode"),
    [
        ("controller", True, "router"),
        ("controller", False, "client"),
        ("router", True, "router"),
        ("a1", False, "client"),
        ("a1", True, "peer"),
        ("viewer", False, "client"),
    ],
)
def test_who_listens_enforces_who_may_say_what_and_all_others_are_clients(tmp_path, role, listens, mode):
    credentials = load(make_fleet(tmp_path), role)
    assert mode_of(credentials, listens=listens) == mode
    found = secure_settings(credentials, listens=listens)
    assert found["transport/link/tls"]["enable_mtls"]
    assert found["transport/link/protocols"] == ["tls"]
    assert ("access_control" in found) == listens
    if listens:
        assert found["access_control"]["default_permission"] == "deny"


def test_without_credentials_all_are_peers_as_ever():
    assert {mode_of(None, listens=listens) for listens in (True, False)} == {"peer"}
