"""`mpc-cover command`: tells a running controller to pause, resume, abort or finish."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import typer

from mpc_cover.cli.network_options import Config, Connect, CredentialsFolder, Insecure, Timeout  # noqa: TC001 - typer reads them
from mpc_cover.cli.operator import replied
from mpc_cover.cli.options import Json, MissionArgument, load, print_json
from mpc_cover.errors import UserError
from mpc_cover.exit_status import exit_status

NAMES = ("pause", "resume", "abort", "finish")


def command(
    name: Annotated[str, typer.Argument(metavar="NAME", help="pause, resume, abort or finish.")],
    mission: MissionArgument,
    connect: Connect = None,
    config: Config = None,
    connect_timeout: Timeout = 10.0,
    credentials: CredentialsFolder = None,
    insecure: Insecure = False,
    as_json: Json = False,
) -> None:
    """Tell a running controller what to do: pause and abort brake at once, finish flies the plan to its end.

    Without -e and --config it connects to tcp/127.0.0.1:7474, where `mpc-cover serve` listens; with --credentials,
    those of the operator, to tls/127.0.0.1:7474. Exit status 1 when the controller refuses, or does not answer.
    """
    from mpc_cover.service.protocol.messages import CommandName  # noqa: PLC0415 - --help needs none of these
    from mpc_cover.service.run.command import command as run_command  # noqa: PLC0415

    if name not in NAMES:
        raise UserError(f"command {name!r}: is none: must be one of {', '.join(NAMES)}")
    loaded = load(mission)
    reply = replied(
        partial(run_command, loaded.spec.name, CommandName(name)),
        "command",
        connect=connect,
        config=config,
        timeout_s=connect_timeout,
        credentials=credentials,
        insecure=insecure,
    )
    if as_json:
        print_json({"mission": loaded.spec.name, "accepted": reply.accepted, "phase": reply.phase, "text": reply.text})
    typer.echo(reply.text, err=as_json or not reply.accepted)
    raise typer.Exit(exit_status(holds=reply.accepted))
