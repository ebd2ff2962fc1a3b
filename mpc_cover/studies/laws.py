"""`mpc-cover study laws`: the receding horizon and the potential law on equal dynamics, starts and seeds.

The law is flown as it is meant: each agent by itself, on what it hears from those in range (`service.swarm.agent`).
"""

from __future__ import annotations

import csv
import io
import json
import time
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from mpc_cover.distributed.setup import check_flyable
from mpc_cover.errors import UserError
from mpc_cover.mission.load import load_mission
from mpc_cover.service.run.simulate import simulate
from mpc_cover.service.run.swarm_simulate import fly_swarm
from mpc_cover.studies.starts import random_starts
from mpc_cover.studies.thesis_study import in_parallel
from mpc_cover.verification.check import check_trajectory
from mpc_cover.verification.summary import summarise

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from rich.console import Console
    from rich.table import Table

    from mpc_cover.mission.load import Mission
    from mpc_cover.trajectory_file import Recording

LAWS = {"mpc": "receding horizon", "potential": "potential law"}
_TRAFFIC = ("state", "plan", "word")
"""Keys on which what control needs is sent; status, maps for people and events are not counted."""


class LawRun(msgspec.Struct, frozen=True, kw_only=True):
    """A flight in figures; times [s] are None for never.

    Attributes
    ----------
    effort_m2_per_s3 : the sum over agents of the integral of |u|^2.
    messages, bytes : of states, plans and words sent by everyone, each once, however many hear it.
    compute_ms : of a control step, for each agent: of the controller's step its share.
    prepare_s : planning before the start.
    violations : checks of the independent verifier that fail.
    """

    mission: str
    law: str
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
    starts: str = "random"
    backend: str = "piqp"
    jobs: int = 1


def fly_law(name: str, law: str, seed: int, starts: str, backend: str) -> LawRun:
    """Fly a mission once by one of the laws and measure it."""
    mission = _mission(name, seed, starts)
    traffic: Counter[str] = Counter()

    def counted(key: str, payload: bytes) -> list[bytes]:
        if key.rsplit("/", 1)[-1] in _TRAFFIC:
            traffic.update(messages=1, bytes=len(payload))
        return [payload]

    begun = time.perf_counter()
    if law == "mpc":
        flight = simulate(mission, backend=backend, seed=seed, channel=counted)
        taken = np.array([step.tick_time_s for step in flight.steps if step.kind == "step"]) / mission.fleet.size
        before = sum(step.tick_time_s for step in flight.steps if step.kind == "prepare")
        flown, complete = flight.trajectory, flight.complete
    else:
        swarm = fly_swarm(mission, seed=seed, channel=counted)
        taken, before = np.array([each for one in swarm.decide_s.values() for each in one]), 0.0
        flown, complete = swarm.trajectory, swarm.complete
    return _measured(mission, law, seed, flown, complete, traffic, 1e3 * taken, (before, time.perf_counter() - begun))


def _measured(
    mission: Mission,
    law: str,
    seed: int,
    flown: Recording,
    complete: bool,
    traffic: Counter[str],
    taken_ms: Any,
    wall: tuple[float, float],
) -> LawRun:
    report = check_trajectory(flown)
    summary = summarise(flown, report)
    held = np.diff(flown.time)
    return LawRun(
        mission=mission.spec.name,
        law=law,
        seed=seed,
        agents=mission.fleet.size,
        complete=complete,
        covered_percent=summary.covered_percent,
        time_to_95_s=summary.time_to_95_s,
        time_to_99_s=summary.time_to_99_s,
        time_to_100_s=summary.time_to_100_s,
        ratio_99=summary.ratio_to_bound,
        distance_m=summary.distance_total_m,
        effort_m2_per_s3=float(held @ (flown.input**2).sum(axis=(1, 2))),
        messages=traffic["messages"],
        bytes=traffic["bytes"],
        compute_ms=float(taken_ms.mean()) if taken_ms.size else 0.0,
        compute_p99_ms=float(np.percentile(taken_ms, 99)) if taken_ms.size else 0.0,
        prepare_s=wall[0],
        smallest_separation_m=summary.smallest_separation_m,
        violations=len(report.failures),
        wall_s=wall[1],
    )


def run_laws(options: LawsOptions, out: Path | None, console: Console) -> list[LawRun]:
    """Fly every mission by both laws from every seed; print a table, and write the runs where asked for.

    Raises
    ------
    UserError
        A mission that either law cannot fly, or a folder that cannot be written; before the first flight.
    """
    if options.starts not in {"random", "mission"}:
        raise UserError(f"--starts {options.starts}: must be random or mission")
    for name in options.missions:
        _check(load_mission(name), name)
    if out is not None:
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(f"--out {out}: cannot be made: {error.strerror or error}") from None
    tasks = [
        (name, law, seed, options.starts, options.backend)
        for name in options.missions
        for seed in range(options.seeds)
        for law in LAWS
    ]
    runs: list[LawRun] = []
    for run in in_parallel(fly_law, tasks, options.jobs):
        runs.append(run)
        said = (
            f"{len(runs)} of {len(tasks)}  {run.mission}, {LAWS[run.law]}, seed {run.seed}: {run.covered_percent:g} %"
        )
        console.print(f"{said}, took {run.wall_s:.1f} s", highlight=False, markup=False, soft_wrap=True)
    runs.sort(key=lambda run: (run.mission, run.law, run.seed))
    for mission in dict.fromkeys(run.mission for run in runs):
        console.print(table_of(mission, [run for run in runs if run.mission == mission]))
    if out is not None:
        _write(out, runs)
    return runs


def table_of(mission: str, runs: Sequence[LawRun]) -> Table:
    """Return the medians over the seeds of a mission, a column a law."""
    from rich.table import Table as RichTable  # noqa: PLC0415 - only here

    table = RichTable(title=f"{mission}: medians over {len({run.seed for run in runs})} seeds", title_justify="left")
    table.add_column("")
    by_law = {law: [run for run in runs if run.law == law] for law in LAWS}
    for name in LAWS.values():
        table.add_column(name, justify="right")
    for label, value in _ROWS:
        table.add_row(label, *(value(by_law[law]) for law in LAWS))
    return table


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


def _mission(name: str, seed: int, starts: str) -> Mission:
    mission = load_mission(name)
    if starts == "mission":
        return mission
    start = random_starts(mission, seed)
    agents = tuple(
        agent.model_copy(update={"start_m": tuple(at.tolist())})
        for agent, at in zip(mission.spec.fleet.agents, start, strict=True)
    )
    spec = mission.spec.model_copy(update={"fleet": mission.spec.fleet.model_copy(update={"agents": agents})})
    return replace(mission, spec=spec, fleet=replace(mission.fleet, start=start))


def _check(mission: Mission, name: str) -> None:
    if mission.spec.fleet.dynamics == "single":
        raise UserError(f"mission {name}: fleet.dynamics single: the laws are compared on double integrators")
    check_flyable(mission)


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
