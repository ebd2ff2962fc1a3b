"""An agent without a controller as a process: `mpc-cover agent --controller potential`."""

from __future__ import annotations

import uuid
from dataclasses import replace
from typing import TYPE_CHECKING

from mpc_cover.clock import MonotonicClock
from mpc_cover.control.potential_setup import check_flyable
from mpc_cover.errors import UserError
from mpc_cover.service.daemon import Signals, run
from mpc_cover.service.network import DEFAULT_ENDPOINT, NetworkOptions
from mpc_cover.service.recorder import FileRecorder, Header
from mpc_cover.service.serving import AgentOptions, follow_parent, say
from mpc_cover.service.swarm_agent import SwarmAgent
from mpc_cover.service.transport import open_transport

if TYPE_CHECKING:
    from mpc_cover.mission.load import Mission


def fly_alone(mission: Mission, agent_id: str, options: AgentOptions, network: NetworkOptions) -> int:
    """Be an agent that flies by the potential law until everyone knows that everything is covered.

    Returns
    -------
    0 when everything is covered, 1 when time is up or it came too late, 128 and its number after a signal.

    Raises
    ------
    UserError
        The mission has no such agent, the law cannot fly it, or the network cannot be used as asked.
    """
    if agent_id not in mission.fleet.ids:
        known = ", ".join(mission.fleet.ids)
        raise UserError(f"agent {agent_id!r}: is not in mission {mission.spec.name}: its agents are {known}")
    check_flyable(mission)
    network, instance = _among_themselves(mission, agent_id, network), uuid.uuid4().hex
    with Signals() as signals:
        follow_parent(options.with_parent, signals.stop)
        clock = MonotonicClock(options.speed)
        header = Header(agent_id, instance, mission.spec.name, options.speed)
        recorder = FileRecorder(options.record, header, say) if options.record else None
        try:
            transport = open_transport(network, clock, signals.stop)
        except InterruptedError:
            return signals.exit_status
        try:
            where = ", ".join(network.listen + network.connect) or network.config
            say(f"{agent_id}: agent of {mission.spec.name} without a controller, at {where}")
            agent = SwarmAgent(
                mission,
                agent_id,
                transport,
                clock,
                instance=instance,
                speed=options.speed,
                seed=options.seed,
                recorder=recorder,
                say=say,
            )
            run(agent, clock, signals.stop)
        finally:
            transport.close()
    return signals.exit_status if agent.exit_status is None else agent.exit_status


def _among_themselves(mission: Mission, agent_id: str, network: NetworkOptions) -> NetworkOptions:
    """Return endpoints on loopback where none are given: agent number i listens on its port and connects to all before.

    Peers do not hand on what others say, so everyone needs a line to everyone, as a radio channel gives it; who is in
    range is decided by positions.
    """
    if network.listen or network.connect or network.config:
        return network
    address, _, port = DEFAULT_ENDPOINT.rpartition(":")
    number = mission.fleet.ids.index(agent_id)
    every = [f"{address}:{int(port) + 1 + index}" for index in range(number + 1)]
    return replace(network, listen=(every[number],), connect=tuple(every[:number]))
