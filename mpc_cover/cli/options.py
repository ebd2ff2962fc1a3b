"""Shared by several commands: options, their validation, and the printing of results."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mpc_cover.control.controller_name import ControllerName
from mpc_cover.errors import UserError

if TYPE_CHECKING:
    from rich.console import Console

    from mpc_cover.mission.load import Mission
    from mpc_cover.planning.cvxpy_extra.extra import Extra

DEFAULT_BACKEND = "native"
CONTROLLERS = (ControllerName.MPC, ControllerName.POTENTIAL)

MissionArgument = Annotated[
    str, typer.Argument(metavar="MISSION", help="A mission file (YAML), or the name of one that comes along, as box-3.")
]
OptionalMission = Annotated[
    str, typer.Argument(metavar="[MISSION]", help="A mission file (YAML), or the name of one that comes along.")
]
Missions = Annotated[
    list[str], typer.Argument(metavar="MISSION...", help="Mission files (YAML), or names of those that come along.")
]
Backend = Annotated[
    str, typer.Option("--backend", metavar="NAME", help="native, or the QP back-end of an SQP: piqp, clarabel or osqp.")
]
FlightBackend = Annotated[
    str | None,
    typer.Option(
        "--backend", metavar="NAME", help="solver of the mpc controller: native (the default), piqp, clarabel or osqp."
    ),
]
ControllerOption = Annotated[
    str, typer.Option("--controller", metavar="NAME", help="mpc, or potential: no controller, each agent by itself.")
]
Seed = Annotated[
    int,
    typer.Option("--seed", min=0, help="Seed of whatever is random: guesses, noise, gusts, the potential law's turns."),
]
Speed = Annotated[
    float, typer.Option("--speed", help="Mission seconds that pass in a second; the same for all processes.")
]
RunOut = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Run folder; default runs/MISSION-DATE-TIME.")
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Write over what --out holds already.")]
Kill = Annotated[
    list[str] | None,
    typer.Option("--kill", metavar="AGENT@SECONDS", help="Let an agent die at a mission time [s]; may be repeated."),
]
Jobs = Annotated[
    int | None, typer.Option("--jobs", min=1, help="Runs at a time on this machine; default as many as it has cores.")
]
CpuTime = Annotated[
    bool, typer.Option("--cpu-time", help="Measure processor time, on a machine with other work to do.")
]
ExtraOption = Annotated[
    str | None,
    typer.Option(
        "--extra",
        metavar="MODULE:FUNCTION",
        help="Your terms and constraints in CVXPY, a function(motion, mission).",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout, all else on stderr.")]


def load(mission: str) -> Mission:
    """Return a mission by its file or name; cells that are coarse beside the sensing radii are warned of."""
    from mpc_cover.mission.cell_rules import coarse_warning  # noqa: PLC0415 - --help needs no pydantic
    from mpc_cover.mission.load import load_mission  # noqa: PLC0415 - likewise

    loaded = load_mission(mission)
    if (warning := coarse_warning(loaded.spec)) is not None:
        sys.stderr.write(f"mpc-cover: warning: mission {mission}: {warning}\n")
    return loaded


def check_speed(speed: float) -> None:
    """Refuse a speed at which no time passes."""
    if not math.isfinite(speed) or speed <= 0.0:
        raise UserError(f"--speed {speed:g}: must be a number greater than 0")


def check_seconds(option: str, seconds: float) -> None:
    """Refuse a duration that is not positive and finite."""
    if not math.isfinite(seconds) or seconds <= 0.0:
        raise UserError(f"{option} {seconds:g}: must be a number of seconds greater than 0")


def check_backend(name: str) -> None:
    """Refuse an unknown QP back-end."""
    from solvers.backends.registry import BACKENDS  # noqa: PLC0415 - imports no back-end

    if name not in BACKENDS:
        raise UserError(f"--backend {name}: is none: must be one of {', '.join(BACKENDS)}")


def load_extra_option(name: str | None) -> Extra | None:
    """Return the function that `--extra` names, None for none; the module may lie in the current folder."""
    if name is None:
        return None
    from mpc_cover.planning.cvxpy_extra.loading import load_extra  # noqa: PLC0415 - CVXPY takes a second

    return load_extra(name)


def flight_backend(name: str | None, controller: str) -> str:
    """Return the back-end to fly with.

    Raises
    ------
    UserError
        There is no such back-end, or the controller solves no QP.
    """
    if name is None:
        return DEFAULT_BACKEND
    check_backend(name)
    if controller == ControllerName.POTENTIAL:
        raise UserError(f"--backend {name}: the potential law solves no QP: leave --backend out, or use mpc")
    return name


def controller_for(name: str, mission: Mission) -> ControllerName:
    """Return the controller of a name, which can fly the mission.

    Raises
    ------
    UserError
        There is no such controller, or it cannot fly the mission.
    """
    if name not in CONTROLLERS:
        raise UserError(f"--controller {name}: is none: must be one of {', '.join(CONTROLLERS)}")
    if name == ControllerName.POTENTIAL:
        from mpc_cover.distributed.setup import check_flyable  # noqa: PLC0415 - others need not wait for it

        check_flyable(mission)
    else:
        from mpc_cover.control.factory import require_double  # noqa: PLC0415 - likewise

        require_double(mission)
    return ControllerName(name)


def cores() -> int:
    """Return how many runs this machine can execute at a time."""
    from joblib import cpu_count  # noqa: PLC0415 - it knows the limits of containers

    return int(cpu_count())


def console_for(*, as_json: bool) -> Console:
    """Return the console for users: stderr when stdout is for machines."""
    from rich.console import Console  # noqa: PLC0415 - agents need none

    return Console(stderr=as_json)


def print_json(data: dict[str, Any]) -> None:
    """Print one line of strict JSON."""
    sys.stdout.write(json.dumps(data, allow_nan=False) + "\n")


def finish(console: Console, summary: Any, extra: dict[str, Any], *, as_json: bool, where: Path | None) -> None:
    """Print the summary for a person, and as JSON where asked for; `where` is None for what was not written."""
    from mpc_cover.view.tables import print_summary  # noqa: PLC0415 - agents need none

    if summary is not None:
        print_summary(summary, console)
    said = f"written to {where}" if where is not None else "not written: it does not pass the verifier"
    console.print(said, highlight=False, markup=False, soft_wrap=True)
    if as_json:
        print_json({**(summary.to_dict() if summary is not None else {}), **extra})
