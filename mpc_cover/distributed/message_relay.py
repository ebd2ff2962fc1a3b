"""Relays reports to neighbours: each once, and again those that a neighbour reports as missing."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.distributed.state_report import StateReport

MOST_REPAIRS = 24
"""Old reports that are retransmitted at a time."""


class MessageRelay:
    """One agent's store of reports.

    Parameters
    ----------
    agents : m.
    """

    def __init__(self, agents: int) -> None:
        self._log: list[dict[int, StateReport]] = [{} for _ in range(agents)]
        self._fresh: list[StateReport] = []
        self._missing: dict[int, tuple[int, ...]] = {}
        self._due: set[tuple[int, int]] = set()

    def store(self, report: StateReport) -> None:
        """Remember a report, to be retransmitted to agents that miss it."""
        self._log[report.agent][report.sample] = report

    def forward(self, report: StateReport) -> None:
        """Relay a report that is new to this agent, and remember it."""
        self._fresh.append(report)
        if not report.promised:
            self.store(report)

    def note_missing(self, neighbour: int, missing: Sequence[int]) -> None:
        """Note the (m,) first samples that a neighbour reports as not received.

        What it was missing already in its previous message did not reach it: that is sent again.
        """
        before = self._missing.get(neighbour)
        self._missing[neighbour] = tuple(missing)
        if before is None:
            return
        for agent, (first, earlier) in enumerate(zip(missing, before, strict=True)):
            if first == earlier:
                wanted = range(first, first + MOST_REPAIRS)
                self._due.update((agent, sample) for sample in wanted if sample in self._log[agent])

    def take(self) -> list[StateReport]:
        """Return what to send now: new reports since the last call, and retransmissions."""
        fresh, self._fresh = self._fresh, []
        known = {(report.agent, report.sample) for report in fresh if not report.promised}
        again = sorted(self._due - known, key=lambda due: (due[1], due[0]))[:MOST_REPAIRS]
        self._due.clear()
        return fresh + [self._log[agent][sample] for agent, sample in again]
