"""Flies a mission by the potential law from many random starts, and counts those in which everything was measured.

A line per run is appended when it is finished; the run of an incomplete line is flown again.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from mpc_cover.mission.load import load_mission
from mpc_cover.service.protocol.fingerprint import mission_hash
from mpc_cover.studies.progress import CountedProgress
from mpc_cover.studies.starts import Starts
from mpc_cover.studies.swarm_mission import fly_mission
from mpc_cover.studies.thesis_parts import problems_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from pathlib import Path

    from mpc_cover.studies.thesis_parts import Part

    Task = tuple[Path, int]
    Spread = Callable[[Sequence[Task], Callable[[Path, int], "SeedRun"]], Iterable["SeedRun"]]


class SeedRun(msgspec.Struct, frozen=True, kw_only=True):
    """The figures of a run; times [s] are None for never.

    Attributes
    ----------
    mission : fingerprint of the mission.
    time_s : to measure 95, 99 and 100 % of the cells, and until all agents knew.
    problems : problems found, as texts.
    """

    key: str
    mission: str
    seed: int
    time_s: tuple[float | None, float | None, float | None, float | None]
    closest_m: float | None
    bottleneck_m: float
    problems: list[str] = []


class SeedTally(msgspec.Struct, frozen=True, kw_only=True):
    """How many of the seeds of a mission were covered."""

    key: str
    figures: tuple[str, ...]
    covered: int
    flown: int
    median_s: float | None
    worst_s: float | None
    problems: list[str] = []

    @property
    def text(self) -> str:
        """The tally as one line."""
        worst = "never" if self.worst_s is None else f"{self.worst_s:.1f} s"
        times = "" if self.median_s is None else f"; median {self.median_s:.1f} s, worst {worst}"
        return f"{self.key} ({', '.join(self.figures)}): {self.covered} of {self.flown} seeds covered everything{times}"

    def to_dict(self) -> dict[str, Any]:
        """Return it for `--json`."""
        return msgspec.structs.asdict(self)


def fly_seed(path: Path, seed: int) -> SeedRun:
    """Fly a mission file from random starts."""
    mission = load_mission(str(path))
    record = fly_mission(mission, seed, starts=Starts.RANDOM)
    times = (record.time_to(0.95), record.time_to(0.99), record.time_to_cover, record.time_to_know)
    return SeedRun(
        key=path.stem,
        mission=mission_hash(mission),
        seed=seed,
        time_s=tuple(float(time) if np.isfinite(time) else None for time in times),  # type: ignore[arg-type]
        closest_m=float(record.closest) if np.isfinite(record.closest) else None,
        bottleneck_m=float(record.bottleneck),
        problems=problems_of(record),
    )


def run_seeds(folder: Path, parts: Sequence[Part], seeds: int, spread: Spread) -> None:
    """Fly the missing ones of the seeds 0, 1, ... of each part."""
    tasks: list[Task] = []
    for part in parts:
        assert part.mission is not None, "seeds are of missions"
        known = {run.seed for run in _known(folder, part)}
        tasks += [(part.mission, seed) for seed in range(seeds) if seed not in known]
    with CountedProgress(len(tasks), "flights from random starts") as progress:
        for run in spread(tasks, fly_seed):
            with (folder / f"{run.key}.jsonl").open("ab") as file:
                file.write(msgspec.json.encode(run) + b"\n")
            progress.show(f"{run.key}, seed {run.seed}")


def tally(folder: Path, part: Part, seeds: int) -> SeedTally:
    """Count the seeds of a part."""
    runs = sorted((run for run in _known(folder, part) if run.seed < seeds), key=lambda run: run.seed)
    times = np.array([np.inf if run.time_s[2] is None else run.time_s[2] for run in runs])
    median, worst = (float(np.median(times)), float(times.max())) if len(times) else (np.inf, np.inf)
    return SeedTally(
        key=part.key,
        figures=part.figures,
        covered=int(np.isfinite(times).sum()),
        flown=len(runs),
        median_s=median if np.isfinite(median) else None,
        worst_s=worst if np.isfinite(worst) else None,
        problems=[f"{part.key}, seed {run.seed}: {problem}" for run in runs for problem in run.problems],
    )


def _known(folder: Path, part: Part) -> Iterator[SeedRun]:
    """Yield the recorded runs of exactly this mission, each seed once."""
    file = folder / f"{part.key}.jsonl"
    if not file.is_file():
        return
    mission, seen = mission_hash(load_mission(str(part.mission))), set()
    for line in file.read_bytes().splitlines():
        try:
            run = msgspec.json.decode(line, type=SeedRun)
        except msgspec.MsgspecError:
            continue
        if run.mission == mission and run.seed not in seen:
            seen.add(run.seed)
            yield run
