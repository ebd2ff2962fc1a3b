"""`mpc-cover torture`: many flights under faults, each drawn from its seed, judged by an oracle that sees the truth."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from mpc_cover.exit_status import exit_status
from mpc_cover.service.protocol.fingerprint import mission_hash
from mpc_cover.service.run.recording import merge
from mpc_cover.studies.torture_folder import TortureFolder
from mpc_cover.studies.torture_runs import CLEAN_SEED, TortureRun, faults_of, flight_of, shrunk, torture
from mpc_cover.trajectory_file import RecordingKind
from mpc_cover.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.torture.faults import Fault, FaultKind
    from mpc_cover.service.torture.world import Outcome
    from mpc_cover.studies.executors import LocalExecutor
    from mpc_cover.studies.progress import CountedProgress
    from mpc_cover.studies.torture_runs import TortureRecord
    from mpc_cover.trajectory_file import Recording


@dataclass(frozen=True, eq=False)
class Torture:
    """The flights of a torture so far.

    Attributes
    ----------
    clean : the flight without faults.
    records : of the seeds that were asked for, as far as they were flown.
    wanted : how many were asked for.
    interrupted : whether Ctrl-C ended it.
    """

    clean: TortureRecord | None
    records: tuple[TortureRecord, ...]
    wanted: int
    interrupted: bool

    @property
    def violating(self) -> list[TortureRecord]:
        """The flights with a violation, worst first: those with the smallest distance between two agents."""
        return sorted((record for record in self.records if record.violations), key=lambda record: record.smallest_m)

    @property
    def exit_status(self) -> int:
        """0 when all were flown without a violation."""
        holds = not self.violating and len(self.records) >= self.wanted
        if self.clean is not None and self.clean.violations:
            holds = False
        return exit_status(holds=holds, interrupted=self.interrupted)

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain data for `--json`."""
        return {
            "wanted": self.wanted,
            "flown": len(self.records),
            "interrupted": self.interrupted,
            "finished": sum(record.finished for record in self.records),
            "violating": [record.seed for record in self.violating],
            "clean": msgspec.to_builtins(self.clean) if self.clean is not None else None,
            "records": [msgspec.to_builtins(record) for record in self.records],
        }


def run_torture(
    mission: Mission,
    kinds: Sequence[FaultKind],
    seeds: Sequence[int],
    out: Path,
    executor: LocalExecutor,
    *,
    backend: str = "native",
    overwrite: bool = False,
    progress: Callable[[int], CountedProgress],
) -> Torture:
    """Fly the seeds that are not in the folder `out` yet, and the flight without faults.

    Parameters
    ----------
    kinds : of the faults that are drawn from; a seed draws other faults from others.
    progress : returns a display of so many flights.

    Raises
    ------
    UserError
        The folder holds something else, or cannot be written.
    """
    what: dict[str, object] = {"mission": mission_hash(mission), "kinds": list(kinds), "backend": backend}
    folder = TortureFolder(out, what, overwrite=overwrite)
    folder.open()
    todo = [seed for seed in (CLEAN_SEED, *seeds) if folder.known(seed) is None]
    runs = [TortureRun(mission.to_json(), backend, tuple(kinds), seed) for seed in todo]
    interrupted = False
    try:
        with executor as ready, progress(len(runs)) as shown, closing(ready.fly(runs, torture)) as records:
            for record in records:
                folder.keep(record)
                for violation in record.violations:
                    shown.say(f"seed {record.seed}, {record.kind or 'no faults'}: {violation.line}")
                shown.show(f"seed {record.seed}: {record.text}")
    except KeyboardInterrupt:
        interrupted = True
    return Torture(folder.known(CLEAN_SEED), tuple(folder.records(seeds)), len(seeds), interrupted)


@dataclass(frozen=True, eq=False)
class Replay:
    """The flight of one seed, with the fewest faults that lead to its violations; those of the seed without any."""

    kind: str
    faults: tuple[Fault, ...]
    outcome: Outcome
    fewest: tuple[Fault, ...]


def replay(
    mission: Mission,
    kinds: Sequence[FaultKind],
    seed: int,
    backend: str,
    *,
    shrink: bool,
    on_try: Callable[[int, str], None],
) -> Replay:
    """Fly one seed again, and shrink its faults where it violates something."""
    kind, faults = faults_of(mission, kinds, seed)
    outcome = flight_of(mission, faults, seed, backend)
    fewest = faults
    if shrink and outcome.violations and faults:
        fewest = shrunk(mission, faults, seed, backend, on_try=on_try)
    return Replay(kind, faults, outcome, fewest)


def recording_of(mission: Mission, outcome: Outcome, seed: int, backend: str) -> Recording:
    """Return what was flown as a recording that `check` and `plot` read.

    Raises
    ------
    UnreadableFileError
        Nothing was flown.
    """
    meta = {"kind": RecordingKind.SIMULATE, "version": __version__, "seed": seed, "backend": backend}
    return merge(mission, [outcome.motions[name] for name in mission.fleet.ids], meta, outcome.died)


def worst_ratio(records: Sequence[TortureRecord], clean: TortureRecord | None) -> tuple[float, float]:
    """Return median and worst time to cover over that without faults, of flights that finished; NaN for none."""
    times = [record.covered_s for record in records if record.covered_s is not None]
    if clean is None or not clean.covered_s or not times:
        return np.nan, np.nan
    ratios = np.array(times) / clean.covered_s
    return float(np.median(ratios)), float(ratios.max())
