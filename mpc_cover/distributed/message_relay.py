"""What an agent passes on: every news once, and what a neighbour says that it still lacks."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.distributed.state_report import Report

MOST_REPAIRS = 24
"""Old reports that are sent again at a time."""


class MessageRelay:
    """One agent's memory of reports.

    Parameters
    ----------
    agents : m.
    """

    def __init__(self, agents: int) -> None:
        self._log: list[dict[int, Report]] = [{} for _ in range(agents)]
        self._news: list[Report] = []
        self._lacks: dict[int, tuple[int, ...]] = {}
        self._due: set[tuple[int, int]] = set()

    def keep(self, report: Report) -> None:
        """Remember a report, to be sent to those who lack it."""
        self._log[report.agent][report.sample] = report

    def learn(self, report: Report) -> None:
        """Pass on a report that is new to this agent, and remember it."""
        self._news.append(report)
        if not report.promised:
            self.keep(report)

    def lacks(self, neighbour: int, missing: Sequence[int]) -> None:
        """Note the (m,) first samples that a neighbour lacks, by its own word.

        What it lacked already when it spoke last did not reach it: it is sent again.
        """
        before = self._lacks.get(neighbour)
        self._lacks[neighbour] = tuple(missing)
        if before is None:
            return
        for agent, (first, earlier) in enumerate(zip(missing, before, strict=True)):
            if first == earlier:
                wanted = range(first, first + MOST_REPAIRS)
                self._due.update((agent, sample) for sample in wanted if sample in self._log[agent])

    def take(self) -> list[Report]:
        """Return what to send now: news since the last call, and repairs."""
        fresh, self._news = self._news, []
        known = {(report.agent, report.sample) for report in fresh if not report.promised}
        again = sorted(self._due - known, key=lambda due: (due[1], due[0]))[:MOST_REPAIRS]
        self._due.clear()
        return fresh + [self._log[agent][sample] for agent, sample in again]
