"""Flies the runs of a study that are missing from its folder, and keeps each when it is finished."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpc_cover.exit_status import exit_status
from mpc_cover.studies.progress import StudyProgress
from mpc_cover.studies.results import StudyFolder
from mpc_cover.view.progress import ProgressLine

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from rich.console import Console

    from mpc_cover.studies.executors import Executor
    from mpc_cover.studies.grid import Work
    from mpc_cover.studies.measure import Fly
    from mpc_cover.studies.record import Record
    from mpc_cover.studies.runs import Run


@dataclass(frozen=True, eq=False)
class Campaign:
    """What a study has flown so far.

    Attributes
    ----------
    folder : the results of all runs, of earlier studies in it as well.
    wanted : how many runs were asked for.
    found : the records of those that are finished.
    interrupted : whether Ctrl-C ended it.
    """

    folder: StudyFolder
    wanted: int
    found: tuple[Record, ...]
    interrupted: bool

    @property
    def broken(self) -> int:
        """How many of the runs broke off; they are flown again next time."""
        return sum(bool(record.error) for record in self.found)

    @property
    def exit_status(self) -> int:
        """0 when every run was flown, whatever its result."""
        holds = len(self.found) >= self.wanted and self.broken == 0
        return exit_status(holds=holds, interrupted=self.interrupted)

    def announce_end(self, console: Console) -> None:
        """Say how far the study got, if that is not to its end."""
        if self.interrupted or len(self.found) < self.wanted:
            console.print(
                f"stopped: {len(self.found)} of {self.wanted} runs are finished; the same command goes on from there",
                highlight=False,
            )


def fly_missing(work: Work, out: Path, executor: Executor, console: Console, *, command: str, fly: Fly) -> Campaign:
    """Fly the runs of `work` that are not in the folder `out` yet.

    Parameters
    ----------
    executor : flies them; entered before anything is written.
    command : the command line, kept with the results.
    fly : flies one run; must be importable in the executor's workers.

    Raises
    ------
    UserError
        The folder holds something else, or cannot be written.
    """
    with executor as ready:
        folder = StudyFolder(out, work.fingerprints, command)
        folder.open()
        todo = [run for run in work.runs if run.key not in folder.finished]
        _announce(console, work.remarks, folder, len(work.runs), len(todo))
        line = ProgressLine(console if console.quiet else None, leave=True)
        interrupted = _fly(ready, todo, folder, fly, line)
    wanted = {run.key for run in work.runs}
    found = tuple(record for record in folder.records if record.key in wanted)
    return Campaign(folder, len(wanted), found, interrupted)


def _announce(console: Console, remarks: Sequence[str], folder: StudyFolder, wanted: int, todo: int) -> None:
    kept = f", {wanted - todo} of them already there" if todo < wanted else ""
    damaged = f"{folder.damaged} files in {folder.path}/runs cannot be read and do not count"
    for line in (*remarks, *([damaged] if folder.damaged else []), f"{wanted} runs{kept}; results in {folder.path}"):
        console.print(line, highlight=False, markup=False, soft_wrap=True)


def _fly(executor: Executor, runs: Sequence[Run], folder: StudyFolder, fly: Fly, line: ProgressLine) -> bool:
    """Fly the runs and keep their records; return whether Ctrl-C interrupted it."""
    if not runs:
        return False
    try:
        with StudyProgress(len(runs), line=line) as progress, closing(executor.fly(runs, fly)) as records:
            for record in records:
                folder.keep(record)
                progress.count(record)
    except KeyboardInterrupt:
        return True
    return False
