"""A free port is one that nobody listens on."""

import socket

import pytest

from mpc_cover.errors import UserError
from mpc_cover.service.run import processes
from mpc_cover.service.run.processes import free_port


def test_a_free_port_is_one(monkeypatch):
    port = free_port()
    assert free_port([port]) != port
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", port))
        monkeypatch.setattr(processes, "PORTS", range(port, port + 1))
        with pytest.raises(UserError, match="no port"):
            free_port()
