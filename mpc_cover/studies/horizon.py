"""`mpc-cover study horizon`: fly the missing runs, keep each when it is finished, and report on all of them."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mpc_cover.exit_status import exit_status
from mpc_cover.studies.grid import runs_of
from mpc_cover.studies.measure import fly
from mpc_cover.studies.progress import StudyProgress
from mpc_cover.studies.report import write_report
from mpc_cover.studies.results import StudyFolder
from mpc_cover.studies.study_table import print_groups
from mpc_cover.studies.tally import group

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from rich.console import Console

    from mpc_cover.studies.executors import Executor
    from mpc_cover.studies.grid import Grid
    from mpc_cover.studies.measure import Fly
    from mpc_cover.studies.runs import Run
    from mpc_cover.studies.tally import Group


@dataclass(frozen=True, eq=False)
class StudyResult:
    """The result of a study.

    Attributes
    ----------
    wanted, finished : how many runs were asked for, and how many of them are finished.
    broken : how many of them broke off; they are flown again next time.
    interrupted : whether Ctrl-C ended it.
    groups : of all runs in the folder, by mission.
    files : written files, the report first.
    """

    wanted: int
    finished: int
    broken: int
    interrupted: bool
    groups: dict[str, list[Group]]
    files: list[Path]

    @property
    def exit_status(self) -> int:
        """0 when every run was flown, whatever its result."""
        holds = self.finished >= self.wanted and self.broken == 0
        return exit_status(holds=holds, interrupted=self.interrupted)

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain data for `--json`."""
        return {
            "wanted": self.wanted,
            "finished": self.finished,
            "broken_off": self.broken,
            "interrupted": self.interrupted,
            "groups": [group.to_dict() for groups in self.groups.values() for group in groups],
            "files": [str(file) for file in self.files],
        }


def run_study(
    grid: Grid,
    out: Path,
    executor: Executor,
    console: Console,
    *,
    command: str,
    fly: Fly = fly,
) -> StudyResult:
    """Fly the runs that are not in `out` yet, and write tables and report of all runs.

    Parameters
    ----------
    executor : flies them; entered before anything is written.
    command : the command line, for the report.
    fly : flies one run; must be importable in the executor's workers.

    Raises
    ------
    UserError
        A run cannot be flown, or the results cannot be written; before the first run where possible.
    """
    work = runs_of(grid)
    with executor as ready:
        folder = StudyFolder(out, work.fingerprints, command)
        folder.open()
        todo = [run for run in work.runs if run.key not in folder.finished]
        _announce(console, work.remarks, folder, len(work.runs), len(todo))
        interrupted = _fly(ready, todo, folder, console, fly)
    groups = group(folder.records)
    files = [*write_report(groups, folder), *folder.write_tables()] if folder.records else []
    print_groups(groups, console)
    wanted = {run.key for run in work.runs}
    found = [record for record in folder.records if record.key in wanted]
    broken = sum(bool(record.error) for record in found)
    if interrupted or len(found) < len(wanted):
        console.print(
            f"stopped: {len(found)} of {len(wanted)} runs are finished; the same command goes on from there",
            highlight=False,
        )
    return StudyResult(len(wanted), len(found), broken, interrupted, groups, files)


def _announce(console: Console, remarks: Sequence[str], folder: StudyFolder, wanted: int, todo: int) -> None:
    kept = f", {wanted - todo} of them already there" if todo < wanted else ""
    damaged = f"{folder.damaged} files in {folder.path}/runs cannot be read and do not count"
    for line in (*remarks, *([damaged] if folder.damaged else []), f"{wanted} runs{kept}; results in {folder.path}"):
        console.print(line, highlight=False, markup=False, soft_wrap=True)


def _fly(executor: Executor, runs: Sequence[Run], folder: StudyFolder, console: Console, fly: Fly) -> bool:
    """Fly the runs and keep their records; return whether Ctrl-C interrupted it."""
    if not runs:
        return False
    try:
        with StudyProgress(console, len(runs)) as progress, closing(executor.fly(runs, fly)) as records:
            for record in records:
                folder.keep(record)
                progress.show(record)
    except KeyboardInterrupt:
        return True
    return False
