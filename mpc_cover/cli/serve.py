"""`mpc-cover serve`: the controller daemon."""

from __future__ import annotations

from pathlib import Path
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
    Backend,
    MissionArgument,
    Overwrite,
    RunOut,
    Seed,
    Speed,
    check_backend,
    check_speed,
    load,
)

StepLog = Annotated[Path | None, typer.Option("--step-log", hidden=True, help="Append each step's figures here.")]


def serve(
    mission: MissionArgument,
    connect: Connect = None,
    listen: Listen = None,
    config: Config = None,
    connect_timeout: Timeout = 10.0,
    credentials: CredentialsFolder = None,
    insecure: Insecure = False,
    state_dir: Annotated[
        Path | None,
        typer.Option("--state-dir", metavar="DIR", help="Where checkpoints are kept; default .mpc-cover/MISSION."),
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Start afresh, whatever the checkpoint says.")] = False,
    stay: Annotated[bool, typer.Option("--stay", help="Go on answering after the mission is complete.")] = False,
    out: RunOut = None,
    overwrite: Overwrite = False,
    seed: Seed = 0,
    backend: Backend = "native",
    speed: Speed = 1.0,
    step_log: StepLog = None,
    with_parent: WithParent = False,
) -> None:
    """Control a mission: wait for its agents, plan, and send them plans until everything is covered.

    What was flown is left in a run folder, as `demo` leaves one; after a restart, what was flown since, in a folder of
    its own: DIR-2, DIR-3, ...

    Without -e, -l and --config it listens on tcp/127.0.0.1:7474, where `mpc-cover agent` looks for it; with
    --credentials on tls/127.0.0.1:7474. Where other machines can reach it, credentials are asked for.
    """
    from mpc_cover.control.factory import require_double  # noqa: PLC0415 - --help needs none of these
    from mpc_cover.service.credentials.roles import CONTROLLER  # noqa: PLC0415
    from mpc_cover.service.run.serve import ServeOptions  # noqa: PLC0415
    from mpc_cover.service.run.serve import serve as run_serve  # noqa: PLC0415

    check_speed(speed)
    check_backend(backend)
    loaded = load(mission)
    require_double(loaded)  # before anything listens
    who = credentials_for(credentials, CONTROLLER, "serve", insecure=insecure)
    network = network_options(
        connect, listen, config, connect_timeout, credentials=who, insecure=insecure, default="listen"
    )
    options = ServeOptions(backend, seed, speed, state_dir, fresh, stay, step_log, with_parent, out, overwrite)
    raise typer.Exit(run_serve(loaded, options, network))
