"""Progress display of a study: a bar on a terminal, periodic lines elsewhere."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Self

from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

if TYPE_CHECKING:
    from types import TracebackType

    from rich.console import Console

    from mpc_cover.studies.record import Record

PLAIN_EVERY_S = 5.0
"""How often a plain line is written [s]."""


class StudyProgress:
    """Counts finished runs; runs that break off are reported at once."""

    def __init__(self, console: Console, total: int) -> None:
        self._console = console
        self._begun = time.monotonic()
        self._due_s = self._begun
        self._done, self._total = 0, total
        self._last = ""
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            disable=not console.is_terminal,
        )
        self._task = self._bar.add_task("starts", total=total)

    def __enter__(self) -> Self:
        """Start the display."""
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the display, with the bar or the last line left on the terminal."""
        self._bar.stop()
        if self._last:
            self._say(self._last)

    def show(self, record: Record) -> None:
        """Count a finished run."""
        self._done += 1
        line = _in_short(record)
        if record.error:
            self._say(f"{line}: {record.error}")
        self._bar.update(self._task, advance=1, description=escape(line))
        if self._console.is_terminal:
            return
        self._last = f"{self._done} of {self._total} runs, about {self._left_s():.0f} s left; {line}"
        if time.monotonic() >= self._due_s:
            self._due_s = time.monotonic() + PLAIN_EVERY_S
            self._say(self._last)
            self._last = ""

    def _left_s(self) -> float:
        """Return an estimate of the remaining time, at the pace so far [s]."""
        return (time.monotonic() - self._begun) / self._done * (self._total - self._done)

    def _say(self, text: str) -> None:
        self._console.print(text, highlight=False, markup=False, soft_wrap=True)


def _in_short(record: Record) -> str:
    horizon = f" {record.horizon_s:g} s" if record.horizon_s is not None else ""
    went = "broke off" if record.error else f"{record.covered_percent:g} %"
    return f"{record.mission} {record.controller}{horizon}, seed {record.seed}: {went}, took {record.wall_s:.1f} s"
