"""`mpc-cover serve` and `mpc-cover agent`: argument parsing only."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mpc_cover import cli_swarm
from mpc_cover.cli_options import Backend, Controller, MissionArgument, Seed, Speed, check_backend, check_speed, load
from mpc_cover.errors import UserError

if TYPE_CHECKING:
    from mpc_cover.service.protocol.network import NetworkOptions

Connect = Annotated[
    list[str] | None,
    typer.Option("-e", "--connect", metavar="ENDPOINT", help="Zenoh endpoint to connect to; may be repeated."),
]
Listen = Annotated[
    list[str] | None,
    typer.Option("-l", "--listen", metavar="ENDPOINT", help="Zenoh endpoint to listen on; may be repeated."),
]
Config = Annotated[Path | None, typer.Option("--config", metavar="FILE", help="Zenoh configuration, JSON5.")]
Timeout = Annotated[
    float, typer.Option("--connect-timeout", help="How long to wait for endpoints to be reachable [s].")
]
WithParent = Annotated[bool, typer.Option("--with-parent", hidden=True, help="End when standard input ends.")]
StepLog = Annotated[Path | None, typer.Option("--step-log", hidden=True, help="Append each step's figures here.")]


def serve(
    mission: MissionArgument,
    connect: Connect = None,
    listen: Listen = None,
    config: Config = None,
    connect_timeout: Timeout = 10.0,
    state_dir: Annotated[
        Path | None,
        typer.Option("--state-dir", metavar="DIR", help="Where checkpoints are kept; default .mpc-cover/MISSION."),
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Start afresh, whatever the checkpoint says.")] = False,
    stay: Annotated[bool, typer.Option("--stay", help="Go on answering after the mission is complete.")] = False,
    seed: Seed = 0,
    backend: Backend = "piqp",
    speed: Speed = 1.0,
    step_log: StepLog = None,
    with_parent: WithParent = False,
) -> None:
    """Control a mission: wait for its agents, plan, and send them plans until everything is covered.

    Without -e, -l and --config it listens on tcp/127.0.0.1:7474, where `mpc-cover agent` looks for it.
    """
    from mpc_cover.service.protocol.network import DEFAULT_ENDPOINT  # noqa: PLC0415 - --help needs none of these
    from mpc_cover.service.run.serve import ServeOptions  # noqa: PLC0415
    from mpc_cover.service.run.serve import serve as run_serve  # noqa: PLC0415

    check_speed(speed)
    check_backend(backend)
    loaded = load(mission)
    cli_swarm.flies_alone("mpc", loaded)  # before anything listens
    network = _network(connect, listen, config, connect_timeout, default_listen=DEFAULT_ENDPOINT)
    options = ServeOptions(backend, seed, speed, state_dir, fresh, stay, step_log, with_parent)
    raise typer.Exit(run_serve(loaded, options, network))


def agent(
    mission: MissionArgument,
    agent_id: Annotated[str, typer.Option("--id", metavar="ID", help="Which of the mission's agents to be.")],
    connect: Connect = None,
    listen: Listen = None,
    config: Config = None,
    connect_timeout: Timeout = 10.0,
    record: Annotated[
        Path | None, typer.Option("--record", metavar="FILE", help="Write the exact motion here, as JSON lines.")
    ] = None,
    seed: Seed = 0,
    speed: Speed = 1.0,
    controller: Controller = "mpc",
    with_parent: WithParent = False,
) -> None:
    """Be one simulated agent: fly the plans that come, each to its end at rest, until a signal comes.

    Without -e, -l and --config it connects to tcp/127.0.0.1:7474, where `mpc-cover serve` listens.

    With --controller potential no plans come: it flies by the potential law on what it hears from the others, and ends
    when all know that everything is covered. Without endpoints the agents of a mission find each other on loopback.
    """
    from mpc_cover.service.protocol.network import DEFAULT_ENDPOINT  # noqa: PLC0415 - --help needs none of these
    from mpc_cover.service.run.serve import AgentOptions, fly  # noqa: PLC0415

    check_speed(speed)
    loaded = load(mission)
    options = AgentOptions(speed, record, with_parent, seed)
    if cli_swarm.flies_alone(controller, loaded):
        from mpc_cover.service.run.swarm_serve import fly_alone  # noqa: PLC0415

        network = _network(connect, listen, config, connect_timeout)
        raise typer.Exit(fly_alone(loaded, agent_id, options, network))
    network = _network(connect, listen, config, connect_timeout, default_connect=DEFAULT_ENDPOINT)
    raise typer.Exit(fly(loaded, agent_id, options, network))


def _network(
    connect: list[str] | None,
    listen: list[str] | None,
    config: Path | None,
    timeout: float,
    *,
    default_connect: str | None = None,
    default_listen: str | None = None,
) -> NetworkOptions:
    """Return the options; the defaults hold only when nothing else is said."""
    from mpc_cover.service.protocol.network import NetworkOptions  # noqa: PLC0415

    if not math.isfinite(timeout) or timeout < 0.0:
        raise UserError(f"--connect-timeout {timeout:g}: must be a number of seconds, 0 or more")
    if not (connect or listen or config):
        connect = [default_connect] if default_connect else []
        listen = [default_listen] if default_listen else []
    return NetworkOptions(tuple(listen or ()), tuple(connect or ()), config, timeout)
