"""`mpc-cover torture`: flights under drawn faults on a virtual clock, judged by an oracle."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mpc_cover.cli.options import (
    DEFAULT_BACKEND,
    Backend,
    Jobs,
    Json,
    MissionArgument,
    Overwrite,
    check_backend,
    console_for,
    cores,
    load,
    print_json,
)
from mpc_cover.errors import UserError
from mpc_cover.exit_status import exit_status

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.torture.faults import FaultKind

ALL = "all"


def torture(
    mission: MissionArgument,
    seeds: Annotated[int, typer.Option("--seeds", min=1, max=1_000_000, help="How many flights.")] = 100,
    first: Annotated[int, typer.Option("--first", min=0, help="The first seed of these.")] = 0,
    faults: Annotated[
        str, typer.Option("--faults", metavar="KINDS", help="all, or kinds of faults, separated by commas.")
    ] = ALL,
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, help="Fly this seed alone, and look for its fewest faults.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Folder of the results, which may hold earlier ones; of one seed, a run folder.",
        ),
    ] = None,
    shrink: Annotated[
        bool, typer.Option("--shrink/--no-shrink", help="Whether to look for the fewest faults of --seed.")
    ] = True,
    backend: Backend = DEFAULT_BACKEND,
    jobs: Jobs = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Fly under faults drawn from seeds: lost, late and repeated messages, dead and stopped processes, and the like.

    The real controller and agents run in one process on virtual time: a seed gives the same flight again. An oracle
    that sees where the agents truly are judges separation, range and limits. A torture that was stopped goes on where
    it was, given the same --out. Exit status 1 when there is a violation.
    """
    from mpc_cover.control.factory import require_double  # noqa: PLC0415 - --help need not wait for these

    check_backend(backend)
    loaded, kinds = load(mission), _kinds(faults)
    require_double(loaded)
    console = console_for(as_json=as_json)
    if seed is not None:
        raise typer.Exit(
            _replay(loaded, kinds, seed, backend, out, console, shrink=shrink, overwrite=overwrite, as_json=as_json)
        )
    from mpc_cover.output import free_path  # noqa: PLC0415 - as above
    from mpc_cover.studies.executors import LocalExecutor  # noqa: PLC0415
    from mpc_cover.studies.progress import CountedProgress  # noqa: PLC0415
    from mpc_cover.studies.torture import run_torture  # noqa: PLC0415
    from mpc_cover.studies.torture_report import print_torture  # noqa: PLC0415

    default = Path("runs") / f"torture-{loaded.spec.name}-{time.strftime('%Y%m%d-%H%M%S')}"
    where = free_path(default) if out is None else out
    result = run_torture(
        loaded,
        kinds,
        range(first, first + seeds),
        where,
        LocalExecutor(jobs or cores()),
        backend=backend,
        overwrite=overwrite,
        progress=lambda total: CountedProgress(total, "flights"),
    )
    print_torture(result, kinds, ["mpc-cover", "torture", mission, "--faults", faults], console)
    console.print(f"results in {where}", highlight=False, markup=False, soft_wrap=True)
    if as_json:
        print_json({"folder": str(where), **result.to_dict()})
    raise typer.Exit(result.exit_status)


def _replay(
    mission: Mission,
    kinds: Sequence[FaultKind],
    seed: int,
    backend: str,
    out: Path | None,
    console: Console,
    *,
    shrink: bool,
    overwrite: bool,
    as_json: bool,
) -> int:
    """Fly one seed again and print what became of it; return the exit status."""
    import msgspec  # noqa: PLC0415 - as above
    import numpy as np  # noqa: PLC0415

    from mpc_cover.service.run.run_folder import RunFolder, run_path  # noqa: PLC0415
    from mpc_cover.studies.torture import recording_of, replay  # noqa: PLC0415
    from mpc_cover.studies.torture_report import print_replay  # noqa: PLC0415
    from mpc_cover.trajectory_file import RecordingKind  # noqa: PLC0415
    from mpc_cover.view.progress import ProgressLine  # noqa: PLC0415

    folder = (
        None if out is None else RunFolder(run_path(out, mission, overwrite=overwrite), RecordingKind.SIMULATE, mission)
    )
    with ProgressLine(console if console.quiet else None) as line:
        line.begin("replay")
        found = replay(
            mission, kinds, seed, backend, shrink=shrink, on_try=lambda number, text: line.show(f"{number}: {text}")
        )
    print_replay(found, console)
    result = {
        "seed": seed,
        "kind": found.kind,
        "faults": msgspec.to_builtins(found.faults),
        "fewest": msgspec.to_builtins(found.fewest),
        "violations": msgspec.to_builtins(found.outcome.violations),
        "outcome": found.outcome.text,
        "smallest_m": found.outcome.smallest_m,
        "digest": found.outcome.digest,
    }
    if folder is not None:
        folder.log("events").write_text("\n".join(found.outcome.events) + "\n", encoding="utf-8")
        folder.write(recording_of(mission, found.outcome, seed, backend), np.zeros(0), result)
        console.print(f"written to {folder.path}", highlight=False, markup=False, soft_wrap=True)
    if as_json:
        print_json(result)
    return exit_status(holds=not found.outcome.violations)


def _kinds(text: str) -> list[FaultKind]:
    """Return the kinds of faults of an option, in the order of their definition.

    Raises
    ------
    UserError
        One is unknown, or there is none.
    """
    from mpc_cover.service.torture.faults import FaultKind  # noqa: PLC0415 - as above

    names = [name.strip() for name in text.split(",") if name.strip()]
    known = [ALL, *FaultKind]
    for name in names:
        if name not in known:
            raise UserError(f"--faults {name}: is none: must be among {', '.join(known)}")
    if not names:
        raise UserError(f"--faults: is empty: give one or more of {', '.join(known)}")
    return [kind for kind in FaultKind if ALL in names or kind in names]
