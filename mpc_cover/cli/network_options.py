"""Options of the commands that join the network."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from mpc_cover.errors import UserError

if TYPE_CHECKING:
    from mpc_cover.service.credentials.folder import Credentials
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
CredentialsFolder = Annotated[
    Path | None,
    typer.Option("--credentials", metavar="DIR", help="Folder of this role, made by `keys new`: encrypt and sign."),
]
FleetFolder = Annotated[
    Path | None,
    typer.Option("--credentials", metavar="DIR", help="Folder of a fleet, made by `keys new`: encrypt and sign."),
]
Insecure = Annotated[
    bool, typer.Option("--insecure", help="Without credentials, use endpoints that strangers may reach, too.")
]
WithParent = Annotated[bool, typer.Option("--with-parent", hidden=True, help="End when standard input ends.")]


def network_options(
    connect: list[str] | None,
    listen: list[str] | None,
    config: Path | None,
    timeout: float,
    *,
    credentials: Credentials | None = None,
    insecure: bool = False,
    default: Literal["connect", "listen"] | None = None,
) -> NetworkOptions:
    """Return the options; without endpoints and a configuration, a `default` one is connected to, or listened on."""
    from mpc_cover.service.protocol.network import NetworkOptions, check_endpoint, default_endpoint  # noqa: PLC0415
    from mpc_cover.service.protocol.secure_network import check_secure  # noqa: PLC0415

    if not math.isfinite(timeout) or timeout < 0.0:
        raise UserError(f"--connect-timeout {timeout:g}: must be a number of seconds, 0 or more")
    if not (connect or listen or config):
        endpoint = default_endpoint(credentials)
        connect = [endpoint] if default == "connect" else []
        listen = [endpoint] if default == "listen" else []
    options = NetworkOptions(tuple(listen or ()), tuple(connect or ()), config, timeout, credentials, insecure)
    for kind, endpoints in (("listen", options.listen), ("connect", options.connect)):
        for each in endpoints:  # before any work; those of a configuration are checked when it is read
            check_secure(check_endpoint(each), kind, credentials, insecure=insecure)
    return options


def credentials_for(folder: Path | None, role: str, what: str, *, insecure: bool) -> Credentials | None:
    """Return the credentials in a folder, which must be those of a role, which `what` needs; None for no folder.

    Raises
    ------
    UserError
        They cannot be used, are another role's, or `--insecure` is given, too.
    """
    if folder is None:
        return None
    if insecure:
        raise UserError("--insecure: leave it out with --credentials: there is nothing insecure about them")
    from mpc_cover.service.credentials.folder import load_credentials  # noqa: PLC0415

    found = load_credentials(folder, warn)
    found.require(role, what)
    return found


def warn(text: str) -> None:
    """Write a warning to stderr."""
    sys.stderr.write(f"mpc-cover: warning: {text}\n")
