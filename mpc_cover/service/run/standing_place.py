"""Where a simulated vehicle stands whose agent is started anew: a real one would know."""

from __future__ import annotations

import contextlib
import time
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.service.protocol.decoding import RejectedError, decode_status
from mpc_cover.service.protocol.keys import Keys

if TYPE_CHECKING:
    from threading import Event

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.protocol.bus import Transport
    from mpc_cover.service.protocol.messages import Status

ALIVE_S = 1.0
"""How long to ask the network at most whether there is a controller [s]; answers come in milliseconds."""
ASK_S = 5.0
"""How long to wait at most for a controller to say where the vehicle stands, and for it to have braked [s]: a status
comes when a process has died. A plain choice, for busy machines."""
POLL_S = 0.02
"""How often to look whether one has come [s]; a plain choice."""


def standing_place(
    mission: Mission, agent_id: str, transport: Transport, stop: Event, *, speed: float = 1.0
) -> FloatArray | None:
    """Return where a simulated vehicle stands, (d,) [m], by the status of a controller that has heard its agent before.

    None where there is no controller, or it has never heard that agent: the vehicle stands at the mission's start. It
    returns when the vehicle has come to rest; `speed` is how many seconds of the controller's clock pass in one.
    """
    keys = Keys(mission.spec.name)
    statuses = transport.inbox(keys.status, 1, history=1)
    if not transport.alive(keys.controller_instance(), ALIVE_S):
        return None
    give_up_s = time.monotonic() + ASK_S
    while time.monotonic() < give_up_s and not stop.is_set():
        for item in statuses.drain():
            with contextlib.suppress(RejectedError):
                status = decode_status(item.payload)
                if agent_id in status.standing or agent_id not in status.instances:
                    stop.wait(min(max(status.still_in_s.get(agent_id, 0.0) / speed, 0.0), ASK_S))
                    return _place_in(status, mission, agent_id)
        stop.wait(POLL_S)
    return None


def _place_in(status: Status, mission: Mission, agent_id: str) -> FloatArray | None:
    """Return where a status says that an agent stands; None where it does not, or no agent of the mission can be."""
    fleet, place = mission.fleet, np.array(status.standing.get(agent_id, []), dtype=float)
    if place.shape != (fleet.dimension,):
        return None
    return place if ((place >= fleet.motion_min) & (place <= fleet.motion_max)).all() else None
