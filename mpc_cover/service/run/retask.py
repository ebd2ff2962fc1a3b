"""The client of `mpc-cover retask`: asks the controller of a mission to continue with another version of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpc_cover.service.protocol.messages import CommandName
from mpc_cover.service.run.command import command

if TYPE_CHECKING:
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.protocol.messages import CommandReply
    from mpc_cover.service.protocol.network import NetworkOptions


def retask(mission: Mission, network: NetworkOptions) -> CommandReply:
    """Return the reply of a running mission's controller to the request to continue with this version of it.

    Raises
    ------
    RequestError
        There is no controller of such a mission, or its reply is malformed.
    UserError
        The mission is too large to be sent, or the network cannot be used as asked.
    """
    return command(mission.spec.name, CommandName.RETASK, network, new_mission=mission.to_json())
