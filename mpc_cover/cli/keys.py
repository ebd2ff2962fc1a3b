"""`mpc-cover keys`: who may speak in a fleet."""

from __future__ import annotations

import ipaddress
import math
import re
from pathlib import Path
from typing import Annotated

import typer

from mpc_cover.cli.options import Overwrite, load
from mpc_cover.errors import UserError
from mpc_cover.output import any_of, check_folder, output_path

app = typer.Typer(name="keys", help="Keys and certificates of a fleet.", no_args_is_help=True)

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
_HOST = re.compile(r"(?!-)[A-Za-z0-9-]{1,63}(\.[A-Za-z0-9-]{1,63})*")
LONGEST_DAYS = 36_500.0
"""A century: what is later breaks the calendar of certificates. A plain choice."""


@app.callback()
def _keys() -> None:
    """Keys and certificates of a fleet."""


@app.command()
def new(
    fleet: Annotated[str, typer.Argument(metavar="FLEET", help="Name of the fleet.")],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Where to put a folder per role; default keys/FLEET.")
    ] = None,
    agents: Annotated[str | None, typer.Option("--agents", metavar="ID,ID,...", help="The agents.")] = None,
    mission: Annotated[
        str | None, typer.Option("--mission", metavar="MISSION", help="A mission with these agents, in their place.")
    ] = None,
    host: Annotated[
        list[str] | None,
        typer.Option(
            "--host",
            metavar="[ROLE=]HOST",
            help="Name or address where controller and router, or that role, listen; may be repeated.",
        ),
    ] = None,
    days: Annotated[float, typer.Option("--days", help="For how many days they hold.")] = 365.0,
    overwrite: Overwrite = False,
) -> None:
    """Make the keys of a new fleet: a folder each for controller, router, operator, viewer, and every agent.

    Copy each to the machine that has the role, and give it to serve, agent, retask and router as --credentials. The
    folder ca makes keys: keep it off all of them. Controller and router may listen on loopback and at each --host;
    agents only where they have one of their own (--host a1=10.0.0.7), for the potential law.
    """
    from mpc_cover.service.credentials.fleet_folder import write_fleet  # noqa: PLC0415 - --help needs none of these

    if not _NAME.fullmatch(fleet):
        raise UserError(f"fleet {fleet!r}: must be letters, digits, and . _ - within, 64 at most")
    if not math.isfinite(days) or not 0.0 < days <= LONGEST_DAYS:
        raise UserError(f"--days {days:g}: must be greater than 0, and {LONGEST_DAYS:g} at most")
    ids = _ids(agents, mission)
    hosts = _hosts(host or [], ids)
    folder = output_path(out, Path("keys") / fleet, any_of("*/*.pem"), overwrite=overwrite)
    check_folder(folder)
    write_fleet(folder, fleet, ids, hosts, days)
    typer.echo(
        f"{folder}: keys of fleet {fleet} for {days:g} days: controller, router, operator, viewer, {', '.join(ids)}"
    )
    typer.echo(f"copy each folder to the machine of that role; keep {folder / 'ca'} off all of them")


def _ids(agents: str | None, mission: str | None) -> tuple[str, ...]:
    """Return the agents' ids, given or those of a mission."""
    from mpc_cover.service.credentials.roles import CA_FOLDER, SERVICE_ROLES  # noqa: PLC0415 - as above

    if (agents is None) == (mission is None):
        raise UserError("keys new: name the agents by --agents a1,a2,..., or a mission that has them by --mission FILE")
    ids = load(mission).fleet.ids if mission is not None else tuple(part.strip() for part in (agents or "").split(","))
    for each in ids:
        if not _NAME.fullmatch(each):
            raise UserError(f"--agents: {each!r}: must be letters, digits, and . _ - within, 64 at most")
        if each.lower() in {*SERVICE_ROLES, CA_FOLDER}:
            raise UserError(f"agent {each!r}: an agent that is to have keys must not be called so: it is a role")
    if len({each.lower() for each in ids}) != len(ids):
        raise UserError(f"--agents {','.join(ids)}: an id must be there only once, whatever its case")
    return ids


def _hosts(given: list[str], ids: tuple[str, ...]) -> dict[str, list[str]]:
    """Return where each role may listen: controller and router on loopback, too."""
    from mpc_cover.service.credentials.roles import CONTROLLER, ROUTER, SERVICE_ROLES  # noqa: PLC0415 - as above

    hosts = {role: ["localhost", "127.0.0.1", "::1"] for role in (CONTROLLER, ROUTER)}
    for each in given:
        role, named, address = each.rpartition("=")
        if not _is_host(address):
            raise UserError(f"--host {each}: must be a name or an address, as 10.0.0.1, or ROLE=10.0.0.1")
        if named and role not in {*ids, *SERVICE_ROLES}:
            raise UserError(
                f"--host {each}: there is no role {role!r}: must be one of {', '.join((*SERVICE_ROLES, *ids))}"
            )
        for listener in [role] if named else [CONTROLLER, ROUTER]:
            hosts.setdefault(listener, []).append(address)
    return hosts


def _is_host(text: str) -> bool:
    try:
        ipaddress.ip_address(text)
    except ValueError:
        return len(text) <= 253 and _HOST.fullmatch(text) is not None  # noqa: PLR2004 - the longest domain name
    return True
