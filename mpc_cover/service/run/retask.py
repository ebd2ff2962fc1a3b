"""The client of `mpc-cover retask`: asks the controller of a mission to continue with another version of it."""

from __future__ import annotations

import uuid
from threading import Event
from typing import TYPE_CHECKING

from mpc_cover.clock import MonotonicClock
from mpc_cover.errors import UserError
from mpc_cover.service.protocol.bus import NoAnswerError, RequestError
from mpc_cover.service.protocol.decoding import MAX_PAYLOAD, RejectedError, decode_reply
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.protocol.messages import CommandName, CommandRequest, encode
from mpc_cover.service.protocol.transport import open_transport

if TYPE_CHECKING:
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.protocol.bus import Transport
    from mpc_cover.service.protocol.messages import CommandReply
    from mpc_cover.service.protocol.network import NetworkOptions

SHORTEST_TIMEOUT_S = 1.0
"""Shortest time to find a controller and wait for its answer [s]."""


def retask(mission: Mission, network: NetworkOptions) -> CommandReply:
    """Return the reply of a running mission's controller to the request to continue with this version of it.

    Raises
    ------
    RequestError
        There is no controller of such a mission, or its reply is malformed.
    UserError
        The mission is too large to be sent, or the network cannot be used as asked.
    """
    name = mission.spec.name
    payload = encode(CommandRequest(request=uuid.uuid4().hex, mission=mission.to_json()))
    if len(payload) > MAX_PAYLOAD:
        right = f"must be at most {MAX_PAYLOAD} to be sent: a coarser area.weights helps"
        raise UserError(f"mission {name}: {len(payload)} bytes: {right}")
    transport = open_transport(network, MonotonicClock(), Event())
    try:
        timeout_s = max(network.connect_timeout_s, SHORTEST_TIMEOUT_S)
        return decode_reply(_ask(transport, Keys(name), payload, timeout_s))
    except RejectedError as error:
        raise RequestError(f"the controller of mission {name}: no reply of this version: {error}") from None
    finally:
        transport.close()


def _ask(transport: Transport, keys: Keys, payload: bytes, timeout_s: float) -> bytes:
    """Return the answer; a controller that is present may be busy planning, and is asked again."""
    presence = transport.presence(keys.controller_alive)
    while True:
        try:
            return transport.ask(keys.command(CommandName.RETASK), payload, timeout_s)
        except NoAnswerError:
            if not presence.alive():
                text = f"no controller of mission {keys.mission} answers within {timeout_s:g} s"
                raise NoAnswerError(f"{text}: is `mpc-cover serve` up, with a mission of this name?") from None
