"""`mpc-cover study laws`: compares receding horizon and potential law on equal dynamics, starts and seeds.

The potential law is flown distributed: each agent by itself, on what it receives from those in range
(`service.swarm.agent`).
"""

from __future__ import annotations

import csv
import io
import json
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from mpc_cover.control.controller_name import ControllerName
from mpc_cover.errors import UserError
from mpc_cover.mission.config import Dynamics
from mpc_cover.mission.load import load_mission
from mpc_cover.output import any_of, check_folder, output_path
from mpc_cover.studies.controllers import BACKEND, check_flight, controller_of, run_flight
from mpc_cover.studies.measure import measured
from mpc_cover.studies.progress import CountedProgress
from mpc_cover.studies.runs import Run
from mpc_cover.studies.starts import Starts
from mpc_cover.studies.thesis_study import in_parallel
from mpc_cover.view.terminal_table import terminal_table

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from rich.console import Console

    from mpc_cover.mission.load import Mission

LAWS = {ControllerName.MPC: "receding horizon", ControllerName.POTENTIAL: "potential law"}
"""The controllers to compare, and their names in tables."""
_SHARED = (
    "agents",
    "complete",
    "covered_percent",
    "time_to_95_s",
    "time_to_99_s",
    "time_to_100_s",
    "ratio_99",
    "distance_m",
    "effort_m2_per_s3",
    "prepare_s",
    "smallest_separation_m",
    "violations",
)
"""Figures in common with `studies.record.Record`."""


class LawRun(msgspec.Struct, frozen=True, kw_only=True):
    """The figures of a flight; times [s] are None for never.

    Attributes
    ----------
    effort_m2_per_s3 : the sum over agents of the integral of |u|^2.
    messages, bytes : of states, plans and broadcasts sent by all, each once, however many receive it.
    compute_ms : of a control step per agent: of the controller's step its share.
    prepare_s : planning before the start.
    violations : checks of the independent verifier that fail.
    """

    mission: str
    law: ControllerName
    seed: int
    agents: int
    complete: bool
    covered_percent: float
    time_to_95_s: float | None
    time_to_99_s: float | None
    time_to_100_s: float | None
    ratio_99: float | None
    distance_m: float
    effort_m2_per_s3: float
    messages: int
    bytes: int
    compute_ms: float
    compute_p99_ms: float
    prepare_s: float
    smallest_separation_m: float | None
    violations: int
    wall_s: float


@dataclass(frozen=True)
class LawsOptions:
    """See `mpc-cover study laws --help`."""

    missions: tuple[str, ...]
    seeds: int = 1
    starts: str = Starts.RANDOM
    backend: str = "native"
    jobs: int = 1
    overwrite: bool = False


def fly_law(run: Run) -> LawRun:
    """Fly a mission once by one of the laws and measure it."""
    begun = time.perf_counter()
    flight = run_flight(run.build(), run.controller, backend=run.backend or BACKEND, seed=run.seed)
    wall_s = time.perf_counter() - begun
    found = measured(flight)
    each_ms = 1e3 * flight.step_s / flight.agents_per_step
    return LawRun(
        mission=run.name,
        law=ControllerName(run.controller),
        seed=run.seed,
        messages=flight.messages,
        bytes=flight.bytes,
        compute_ms=float(each_ms.mean()) if each_ms.size else 0.0,
        compute_p99_ms=float(np.percentile(each_ms, 99)) if each_ms.size else 0.0,
        wall_s=wall_s,
        **{name: found[name] for name in _SHARED},
    )


def run_laws(options: LawsOptions, out: Path | None, console: Console) -> list[LawRun]:
    """Fly every mission by both laws from every seed; print a table, and write the runs where asked for.

    Raises
    ------
    UserError
        A mission that either law cannot fly, or a folder that cannot be written; before the first flight.
    """
    if options.starts not in set(Starts):
        raise UserError(f"--starts {options.starts}: must be random or mission")
    missions = [load_mission(name) for name in options.missions]
    for mission, name in zip(missions, options.missions, strict=True):
        _check(mission, name, options.backend)
    if out is not None:
        check_folder(output_path(out, out, any_of("laws.csv", "laws.json"), overwrite=options.overwrite))
    tasks = [
        (_run_of(mission, law, seed, options),) for mission in missions for seed in range(options.seeds) for law in LAWS
    ]
    runs: list[LawRun] = []
    with CountedProgress(len(tasks)) as progress:
        for run in in_parallel(fly_law, tasks, options.jobs):
            runs.append(run)
            text = f"{run.mission}, {LAWS[run.law]}, seed {run.seed}: {run.covered_percent:g} %"
            progress.show(f"{text}, took {run.wall_s:.1f} s")
    runs.sort(key=lambda run: (run.mission, run.law, run.seed))
    for flown in dict.fromkeys(run.mission for run in runs):
        print_table(flown, [run for run in runs if run.mission == flown], console)
    if out is not None:
        _write(out, runs)
    return runs


def print_table(mission: str, runs: Sequence[LawRun], console: Console) -> None:
    """Print a table of the medians over the seeds of a mission, a column for each law."""
    by_law = {law: [run for run in runs if run.law == law] for law in LAWS}
    rows = [[label, *(value(by_law[law]) for law in LAWS)] for label, value in _ROWS]
    title = f"{mission}: medians over {len({run.seed for run in runs})} seeds"
    console.print(terminal_table(title, ["", *LAWS.values()], rows, console.width))


def _median(runs: Sequence[LawRun], name: str, form: str, scale: float = 1.0) -> str:
    values = [np.inf if (value := getattr(run, name)) is None else scale * value for run in runs]
    middle = float(np.median(values)) if values else np.inf
    return form.format(middle) if np.isfinite(middle) else "never"


_ROWS: list[tuple[str, Callable[[Sequence[LawRun]], str]]] = [
    ("everything covered", lambda runs: f"{sum(run.complete for run in runs)} of {len(runs)}"),
    ("time to 95 %", lambda runs: _median(runs, "time_to_95_s", "{:.1f} s")),
    ("time to 99 %", lambda runs: _median(runs, "time_to_99_s", "{:.1f} s")),
    ("time to 100 %", lambda runs: _median(runs, "time_to_100_s", "{:.1f} s")),
    ("distance, all agents", lambda runs: _median(runs, "distance_m", "{:.0f} m")),
    ("effort, all agents", lambda runs: _median(runs, "effort_m2_per_s3", "{:.0f} m^2/s^3")),
    ("messages sent", lambda runs: _median(runs, "messages", "{:.0f}")),
    ("bytes sent", lambda runs: _median(runs, "bytes", "{:.0f} kB", 1e-3)),
    ("computing, an agent and step", lambda runs: _median(runs, "compute_ms", "{:.1f} ms")),
    ("planning before the start", lambda runs: _median(runs, "prepare_s", "{:.1f} s")),
    ("checks that fail", lambda runs: str(sum(run.violations for run in runs))),
]


def _run_of(mission: Mission, law: ControllerName, seed: int, options: LawsOptions) -> Run:
    control, ahead = mission.spec.control, controller_of(law).plans_ahead
    return Run(
        name=mission.spec.name,
        mission=mission.to_json(),
        controller=law,
        backend=options.backend if ahead else None,
        horizon_steps=control.horizon_steps if ahead else None,
        period_s=control.period_s,
        seed=seed,
        starts=Starts(options.starts),
    )


def _check(mission: Mission, name: str, backend: str) -> None:
    if mission.spec.fleet.dynamics is Dynamics.SINGLE:
        raise UserError(f"mission {name}: fleet.dynamics single: the laws are compared on double integrators")
    for law in LAWS:
        check_flight(mission, law, backend=backend)


def _write(out: Path, runs: Sequence[LawRun]) -> None:
    rows = [msgspec.structs.asdict(run) for run in runs]
    table = io.StringIO(newline="")
    writer = csv.DictWriter(table, fieldnames=list(rows[0]))
    writer.writeheader()
    writer.writerows(rows)
    contents = {"laws.csv": table.getvalue(), "laws.json": json.dumps(rows, indent=2, allow_nan=False) + "\n"}
    try:
        for name, content in contents.items():
            part = out / f"{name}.part"
            part.write_text(content, encoding="utf-8")
            part.replace(out / name)
    except OSError as error:
        raise UserError(f"--out {out}: cannot be written: {error.strerror or error}") from None
