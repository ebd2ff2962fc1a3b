"""The client of commands to a running mission's controller: it finds the controller, asks, and returns its answer."""

from __future__ import annotations

import time
import uuid
from threading import Event
from typing import TYPE_CHECKING

from msgspec.structs import replace

from mpc_cover.clock import MonotonicClock
from mpc_cover.errors import UserError
from mpc_cover.service.protocol.bus import NoAnswerError, RequestError
from mpc_cover.service.protocol.decoding import MAX_PAYLOAD, RejectedError, decode_reply
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.protocol.messages import CommandRequest, encode
from mpc_cover.service.protocol.transport import open_transport

if TYPE_CHECKING:
    from mpc_cover.service.protocol.bus import Transport
    from mpc_cover.service.protocol.messages import CommandName, CommandReply
    from mpc_cover.service.protocol.network import NetworkOptions

SHORTEST_TIMEOUT_S = 1.0
"""Shortest time to find a controller and wait for its answer [s]."""
LOOK_S = 0.05
"""Pause between two looks for a controller [s]; a plain choice."""
UNNAMED = "0" * 32
"""Stands for a controller process, as long as its name, where it needs not be named."""


def command(mission: str, name: CommandName, network: NetworkOptions, *, new_mission: str = "") -> CommandReply:
    """Return the reply of the controller of a mission, by its name, to a command.

    `new_mission` is, for a retask, the new version of the mission as JSON.

    Raises
    ------
    RequestError
        There is no controller of such a mission, or its reply is malformed.
    UserError
        The mission is too large to be sent, or the network cannot be used as asked.
    """
    request = CommandRequest(request=uuid.uuid4().hex, mission=new_mission, controller=UNNAMED)
    if (size := len(encode(request))) > MAX_PAYLOAD:
        right = f"must be at most {MAX_PAYLOAD} to be sent: a coarser area.weights helps"
        raise UserError(f"mission {mission}: {size} bytes: {right}")
    transport = open_transport(network, MonotonicClock(), Event())
    try:
        timeout_s = max(network.connect_timeout_s, SHORTEST_TIMEOUT_S)
        return decode_reply(_ask(transport, Keys(mission), name, request, timeout_s))
    except RejectedError as error:
        raise RequestError(f"the controller of mission {mission}: no reply of this version: {error}") from None
    finally:
        transport.close()


def _ask(transport: Transport, keys: Keys, name: CommandName, request: CommandRequest, timeout_s: float) -> bytes:
    """Return the answer; a controller that is present may be busy planning, and is asked again."""
    presence = transport.presence(keys.controller_alive)
    while True:
        try:
            asked = encode(replace(request, controller=_controller(transport, keys, timeout_s)))
            return transport.ask(keys.command(name), asked, timeout_s)
        except NoAnswerError:
            if not presence.alive():
                text = f"no controller of mission {keys.mission} answers within {timeout_s:g} s"
                raise NoAnswerError(f"{text}: is `mpc-cover serve` up, with a mission of this name?") from None


def _controller(transport: Transport, keys: Keys, timeout_s: float) -> str:
    """Return which controller process there is, where it wants to be named; UNNAMED for none in time."""
    deadline_s = time.monotonic() + timeout_s
    while transport.signed and time.monotonic() < deadline_s:
        if there := transport.alive(keys.controller_instance(), min(timeout_s, SHORTEST_TIMEOUT_S)):
            return there[0].rsplit("/", 1)[-1]
        Event().wait(LOOK_S)
    return UNNAMED
