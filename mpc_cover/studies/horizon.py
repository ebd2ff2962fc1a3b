"""`mpc-cover study horizon`: fly the missing runs, keep each when it is finished, and report on all of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mpc_cover.studies.campaign import fly_missing
from mpc_cover.studies.grid import runs_of
from mpc_cover.studies.measure import fly
from mpc_cover.studies.report import write_report
from mpc_cover.studies.study_table import print_groups
from mpc_cover.studies.tally import group

if TYPE_CHECKING:
    from pathlib import Path

    from rich.console import Console

    from mpc_cover.studies.campaign import Campaign
    from mpc_cover.studies.executors import Executor
    from mpc_cover.studies.grid import Grid
    from mpc_cover.studies.measure import Fly
    from mpc_cover.studies.tally import Group


@dataclass(frozen=True, eq=False)
class StudyResult:
    """The result of a study.

    Attributes
    ----------
    campaign : what was flown.
    groups : of all runs in the folder, by mission.
    files : written files, the report first.
    """

    campaign: Campaign
    groups: dict[str, list[Group]]
    files: list[Path]

    @property
    def wanted(self) -> int:
        """How many runs were asked for."""
        return self.campaign.wanted

    @property
    def finished(self) -> int:
        """How many of them are finished."""
        return len(self.campaign.found)

    @property
    def broken(self) -> int:
        """How many of them broke off; they are flown again next time."""
        return self.campaign.broken

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C ended it."""
        return self.campaign.interrupted

    @property
    def exit_status(self) -> int:
        """0 when every run was flown, whatever its result."""
        return self.campaign.exit_status

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
    campaign = fly_missing(runs_of(grid), out, executor, console, command=command, fly=fly)
    folder = campaign.folder
    groups = group(folder.records)
    files = [*write_report(groups, folder), *folder.write_tables()] if folder.records else []
    print_groups(groups, console)
    campaign.announce_end(console)
    return StudyResult(campaign, groups, files)
