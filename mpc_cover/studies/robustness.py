"""`mpc-cover study robustness`: missions of every shape, moved, scaled, turned, and crowds; the worst of each kind."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mpc_cover.studies.campaign import fly_missing
from mpc_cover.studies.measure import fly
from mpc_cover.studies.robustness_cases import cases, work_of
from mpc_cover.studies.robustness_report import print_tables, write_report
from mpc_cover.studies.robustness_result import results_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from rich.console import Console

    from mpc_cover.studies.campaign import Campaign
    from mpc_cover.studies.executors import Executor
    from mpc_cover.studies.measure import Fly
    from mpc_cover.studies.robustness_result import RobustnessResult


@dataclass(frozen=True, eq=False)
class RobustnessStudy:
    """The result of the study: a result for each case flown, and the files written, the report first."""

    campaign: Campaign
    results: tuple[RobustnessResult, ...]
    files: tuple[Path, ...]

    @property
    def exit_status(self) -> int:
        """0 when every case passes."""
        return self.campaign.exit_status or int(not all(result.passes for result in self.results))

    def to_dict(self) -> dict[str, Any]:
        """Return the study as plain data for `--json`."""
        return {
            "wanted": self.campaign.wanted,
            "finished": len(self.campaign.found),
            "interrupted": self.campaign.interrupted,
            "passing": sum(result.passes for result in self.results),
            "results": [result.to_dict() for result in self.results],
            "files": [str(file) for file in self.files],
        }


def run_robustness(
    only: Sequence[str], out: Path, executor: Executor, console: Console, *, command: str, fly: Fly = fly
) -> RobustnessStudy:
    """Fly the cases that are not in `out` yet, and write table, picture and report of those asked for.

    Parameters
    ----------
    only : rows or columns of the table; empty for all.
    executor, command, fly : see `campaign.fly_missing`.

    Raises
    ------
    UserError
        `only` names none, or the results cannot be written.
    """
    some = cases(only)
    campaign = fly_missing(work_of(some), out, executor, console, command=command, fly=fly)
    results = tuple(results_of(some, campaign.found))
    print_tables(results, console)
    campaign.announce_end(console)
    files = [*write_report(results, campaign.folder), *campaign.folder.write_tables()] if campaign.found else []
    return RobustnessStudy(campaign, results, tuple(files))
