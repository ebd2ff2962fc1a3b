"""The bus in memory."""

import pytest

from mpc_cover.clock import VirtualClock
from mpc_cover.service.protocol.bus import RequestError
from mpc_cover.service.protocol.local import LocalBus


def test_a_bus_in_memory_cannot_wait():
    with pytest.raises(RequestError):
        LocalBus(VirtualClock()).join().ask("key", b"", 1.0)
