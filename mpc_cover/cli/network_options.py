"""Options of the commands that join the network."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

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


def network_options(
    connect: list[str] | None,
    listen: list[str] | None,
    config: Path | None,
    timeout: float,
    *,
    default_connect: str | None = None,
    default_listen: str | None = None,
) -> NetworkOptions:
    """Return the options; the defaults apply only when neither endpoints nor a configuration are given."""
    from mpc_cover.service.protocol.network import NetworkOptions  # noqa: PLC0415

    if not math.isfinite(timeout) or timeout < 0.0:
        raise UserError(f"--connect-timeout {timeout:g}: must be a number of seconds, 0 or more")
    if not (connect or listen or config):
        connect = [default_connect] if default_connect else []
        listen = [default_listen] if default_listen else []
    return NetworkOptions(tuple(listen or ()), tuple(connect or ()), config, timeout)
