"""The router as a process: `mpc-cover router`."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from mpc_cover.clock import MonotonicClock
from mpc_cover.service.protocol.transport import open_transport
from mpc_cover.service.run.daemon import Signals
from mpc_cover.service.run.serve import follow_parent, speaker

if TYPE_CHECKING:
    from mpc_cover.service.protocol.network import NetworkOptions


def run_router(network: NetworkOptions, *, with_parent: bool = False) -> int:
    """Pass messages on until a signal comes; return the exit status.

    Raises
    ------
    UserError
        The network cannot be used as asked.
    """
    with Signals(child=with_parent) as signals:
        follow_parent(with_parent, signals.stop)
        try:
            transport = open_transport(replace(network, routes=True), MonotonicClock(), signals.stop)
        except InterruptedError:
            return signals.exit_status
        speaker(network)(f"passes messages on at {network.where}")
        signals.stop.wait()
        transport.close()
        return signals.exit_status
