"""`mpc-cover router`: passes messages on between a controller and its agents."""

from __future__ import annotations

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


def router(
    connect: Connect = None,
    listen: Listen = None,
    config: Config = None,
    connect_timeout: Timeout = 10.0,
    credentials: CredentialsFolder = None,
    insecure: Insecure = False,
    with_parent: WithParent = False,
) -> None:
    """Pass messages on, until a signal comes: controller, agents and operator all connect to it by -e.

    A controller that is started again does not look like the loss of all agents then. With --credentials it enforces
    who may say what; what it passes on is signed, so that whoever takes it over can delay, but not steer.

    Without -e, -l and --config it listens on tcp/127.0.0.1:7474, with --credentials on tls/127.0.0.1:7474.
    """
    from mpc_cover.service.credentials.roles import ROUTER  # noqa: PLC0415 - --help needs none of these
    from mpc_cover.service.run.router import run_router  # noqa: PLC0415

    who = credentials_for(credentials, ROUTER, "router", insecure=insecure)
    network = network_options(
        connect, listen, config, connect_timeout, credentials=who, insecure=insecure, default="listen"
    )
    raise typer.Exit(run_router(network, with_parent=with_parent))
