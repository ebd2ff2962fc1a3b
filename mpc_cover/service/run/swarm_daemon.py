"""The daemon of an agent without a controller: `mpc-cover agent --controller potential`."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from mpc_cover.distributed.setup import check_flyable
from mpc_cover.service.protocol.network import default_endpoint
from mpc_cover.service.run.serve import check_agent_id, run_agent_process
from mpc_cover.service.swarm.agent import SwarmAgent

if TYPE_CHECKING:
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.protocol.network import NetworkOptions
    from mpc_cover.service.run.serve import AgentOptions


def run_swarm_agent(mission: Mission, agent_id: str, options: AgentOptions, network: NetworkOptions) -> int:
    """Run an agent that flies by the potential law until all agents know that everything is covered.

    Returns
    -------
    0 when everything is covered or after SIGTERM, 1 when time is up or it came too late, 130 after Ctrl-C.

    Raises
    ------
    UserError
        The mission has no such agent, the law cannot fly it, or the network cannot be used as asked.
    """
    check_agent_id(mission, agent_id)
    check_flyable(mission)
    network = _with_default_endpoints(mission, agent_id, network)
    text = f"{agent_id}: agent of {mission.spec.name} without a controller, at {network.where}"
    agent, status = run_agent_process(SwarmAgent, mission, agent_id, options, network, text)
    return status if agent is None or agent.exit_status is None else agent.exit_status


def _with_default_endpoints(mission: Mission, agent_id: str, network: NetworkOptions) -> NetworkOptions:
    """Return endpoints on loopback where none are given: agent number i listens on its port and connects to all before.

    Peers do not forward messages, so each agent needs a connection to every other, as a radio channel has; which
    agents are in range is decided by positions.
    """
    if network.listen or network.connect or network.config:
        return network
    address, _, port = default_endpoint(network.credentials).rpartition(":")
    number = mission.fleet.ids.index(agent_id)
    every = [f"{address}:{int(port) + 1 + index}" for index in range(number + 1)]
    return replace(network, listen=(every[number],), connect=tuple(every[:number]))
