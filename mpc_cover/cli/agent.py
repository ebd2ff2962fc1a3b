"""`mpc-cover agent`: one simulated agent."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads the annotations
from typing import Annotated

import typer

from mpc_cover.cli.network_options import (
    Config,
    Connect,
    CredentialsFolder,
    Insecure,
    Listen,
    Timeout,
    WithParent,
    credentials_for,
    network_options,
)
from mpc_cover.cli.options import (
    ControllerOption,
    MissionArgument,
    Seed,
    Speed,
    check_speed,
    controller_for,
    load,
)
from mpc_cover.control.controller_name import ControllerName
from mpc_cover.output import file_taken, output_path


def agent(
    mission: MissionArgument,
    agent_id: Annotated[str, typer.Option("--id", metavar="ID", help="Which of the mission's agents to be.")],
    connect: Connect = None,
    listen: Listen = None,
    config: Config = None,
    connect_timeout: Timeout = 10.0,
    credentials: CredentialsFolder = None,
    insecure: Insecure = False,
    record: Annotated[
        Path | None, typer.Option("--record", metavar="FILE", help="Write the exact motion here, as JSON lines.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Write over what --record holds already.")] = False,
    seed: Seed = 0,
    speed: Speed = 1.0,
    controller: ControllerOption = ControllerName.MPC.value,
    with_parent: WithParent = False,
) -> None:
    """Be one simulated agent: fly the plans that come, each to its end at rest, until a signal comes.

    Without -e, -l and --config it connects to tcp/127.0.0.1:7474, where `mpc-cover serve` listens; with --credentials
    to tls/127.0.0.1:7474, and flies no plan but those that the fleet's controller has signed.

    With --controller potential no plans come: it flies by the potential law on what it hears from the others, and ends
    when all know that everything is covered. Without endpoints the agents of a mission find each other on loopback.
    """
    from mpc_cover.service.run.serve import AgentOptions, check_agent_id, run_agent  # noqa: PLC0415 - slow to import

    check_speed(speed)
    loaded = load(mission)
    check_agent_id(loaded, agent_id)
    who = credentials_for(credentials, agent_id, f"agent --id {agent_id}", insecure=insecure)
    if record is not None:
        output_path(record, record, file_taken, overwrite=overwrite, option="--record")
    options = AgentOptions(speed, record, with_parent, seed)
    if controller_for(controller, loaded) is ControllerName.POTENTIAL:
        from mpc_cover.service.run.swarm_daemon import run_swarm_agent  # noqa: PLC0415

        network = network_options(connect, listen, config, connect_timeout, credentials=who, insecure=insecure)
        raise typer.Exit(run_swarm_agent(loaded, agent_id, options, network))
    network = network_options(
        connect, listen, config, connect_timeout, credentials=who, insecure=insecure, default="connect"
    )
    raise typer.Exit(run_agent(loaded, agent_id, options, network))
