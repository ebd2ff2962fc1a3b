"""Progress display of a study: how many of its runs are finished, and the last of them."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Self

from mpc_cover.view.progress import ProgressLine

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

    from mpc_cover.studies.record import Record


class CountedProgress:
    """Counts what is finished of so much, and estimates what is left.

    Parameters
    ----------
    what : of which there are `total`, in words.
    line : where it is shown; None for a line on stderr.
    monotonic : seconds of a clock.
    """

    def __init__(
        self,
        total: int,
        what: str = "runs",
        line: ProgressLine | None = None,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self._line, self._monotonic, self._what = line or ProgressLine(leave=True), monotonic, what
        self._begun, self._done, self._total = monotonic(), 0, total

    def __enter__(self) -> Self:
        """Start the display."""
        self._line.__enter__()
        self._line.begin("study")
        self._line.show(f"0 of {self._total} {self._what}")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the display, with the last line left behind."""
        self._line.__exit__(kind, error, trace)

    def show(self, text: str) -> None:
        """Count something that is finished, which the text tells of."""
        self._done += 1
        left_s = (self._monotonic() - self._begun) / self._done * (self._total - self._done)
        done = f"{self._done} of {self._total} {self._what}, about {left_s:.0f} s left"
        self._line.show(f"{done}; {text}", self._done / self._total)

    def say(self, text: str) -> None:
        """Write a permanent line."""
        self._line.say(text)


class StudyProgress(CountedProgress):
    """Counts finished runs; runs that break off are reported at once."""

    def count(self, record: Record) -> None:
        """Count a finished run."""
        line = _in_short(record)
        if record.error:
            self.say(f"{line}: {record.error}")
        self.show(line)


def _in_short(record: Record) -> str:
    horizon = f" {record.horizon_s:g} s" if record.horizon_s is not None else ""
    went = "broke off" if record.error else f"{record.covered_percent:g} %"
    return f"{record.mission} {record.controller}{horizon}, seed {record.seed}: {went}, took {record.wall_s:.1f} s"
