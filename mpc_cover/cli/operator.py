"""What `command` and `retask` have in common: the operator asks a running controller, and hears its reply."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import typer

from mpc_cover.cli.network_options import credentials_for, network_options
from mpc_cover.exit_status import exit_status

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from mpc_cover.service.protocol.messages import CommandReply
    from mpc_cover.service.protocol.network import NetworkOptions


def replied(
    ask: Callable[[NetworkOptions], CommandReply],
    what: str,
    *,
    connect: list[str] | None,
    config: Path | None,
    timeout_s: float,
    credentials: Path | None,
    insecure: bool,
) -> CommandReply:
    """Return the controller's reply to what a command asks over the network that its options give.

    Raises
    ------
    typer.Exit
        With exit status 1: there is no controller, or no reply.
    """
    from mpc_cover.service.credentials.roles import OPERATOR  # noqa: PLC0415 - --help needs none of these
    from mpc_cover.service.protocol.bus import RequestError, UnreachableError  # noqa: PLC0415

    who = credentials_for(credentials, OPERATOR, what, insecure=insecure)
    network = network_options(connect, None, config, timeout_s, credentials=who, insecure=insecure, default="connect")
    try:
        return ask(network)
    except (UnreachableError, RequestError) as error:
        sys.stderr.write(f"mpc-cover: {error}\n")
        raise typer.Exit(exit_status(holds=False)) from None
