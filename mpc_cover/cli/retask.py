"""`mpc-cover retask`: another version of the mission for a fleet in flight."""

from __future__ import annotations

import sys
from functools import partial
from typing import TYPE_CHECKING

import typer

from mpc_cover.cli.network_options import Config, Connect, CredentialsFolder, Insecure, Timeout  # noqa: TC001 - typer reads them
from mpc_cover.cli.operator import replied
from mpc_cover.cli.options import Json, MissionArgument, load, print_json
from mpc_cover.exit_status import exit_status

if TYPE_CHECKING:
    from mpc_cover.service.protocol.messages import CommandReply


def retask(
    mission: MissionArgument,
    connect: Connect = None,
    config: Config = None,
    connect_timeout: Timeout = 10.0,
    credentials: CredentialsFolder = None,
    insecure: Insecure = False,
    as_json: Json = False,
) -> None:
    """Let a running controller go on with another version of its mission, for the same fleet, without a restart.

    Without -e and --config it connects to tcp/127.0.0.1:7474, where `mpc-cover serve` listens. Exit status 1 when the
    controller refuses, or does not answer.
    """
    from mpc_cover.control.factory import require_double  # noqa: PLC0415 - --help needs none of these
    from mpc_cover.service.run.retask import retask as run_retask  # noqa: PLC0415

    loaded = load(mission)
    require_double(loaded)
    reply = replied(
        partial(run_retask, loaded),
        "retask",
        connect=connect,
        config=config,
        timeout_s=connect_timeout,
        credentials=credentials,
        insecure=insecure,
    )
    _print(reply, loaded.spec.name, as_json=as_json)
    raise typer.Exit(exit_status(holds=reply.accepted))


def _print(reply: CommandReply, name: str, *, as_json: bool) -> None:
    """Print the controller's reply; a refusal goes to stderr."""
    if as_json:
        result = {"accepted": reply.accepted, "phase": reply.phase, "text": reply.text, "problems": reply.problems}
        print_json({"mission": name, **result})
    if reply.accepted:
        typer.echo(reply.text, err=as_json)
    else:
        problems = "".join(f"\n  {problem}" for problem in reply.problems)
        sys.stderr.write(f"mpc-cover: mission {name}: {reply.text}{problems}\n")
