"""What a person sees while a mission is flown: a line that changes on a terminal, plain lines elsewhere."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from types import TracebackType

    from rich.console import Console
    from rich.status import Status as Spinner

    from mpc_cover.service.messages import Status

PLAIN_EVERY_S = 2.0
"""How often a plain line is written [s]."""
BAR = 20


def describe(status: Status) -> str:
    """Return a status as one line; what is not complete is never shown as 100 %."""
    percent = (1000 * status.covered_count // max(1, status.cell_count)) / 10
    return (
        f"covered {percent:5.1f} %, {status.mission_time_s:5.1f} s, "
        f"step {status.step_ms:4.0f} ms, missed {status.deadline_misses}"
    )


class Progress:
    """Shows the newest status, and events above it."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._spinner: Spinner | None = None
        self._due_s = 0.0
        self._last = ""

    def __enter__(self) -> Self:
        """Begin to show."""
        if self._console.is_terminal:
            self._spinner = self._console.status("starts")
            self._spinner.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave the last line behind."""
        if self._spinner is not None:
            self._spinner.stop()
            self._spinner = None
        if self._last:
            self._console.print(self._last, highlight=False, markup=False)

    def say(self, text: str) -> None:
        """Write a line that stays."""
        self._console.print(text, highlight=False, markup=False, soft_wrap=True)

    def show(self, status: Status) -> None:
        """Show how things stand."""
        line = describe(status)
        if self._spinner is not None:
            filled = BAR * status.covered_count // max(1, status.cell_count)
            full, empty = "█░" if self._console.encoding.startswith("utf") else "#-"
            self._spinner.update(f"{full * filled}{empty * (BAR - filled)} {line}")
        elif line != self._last and time.monotonic() >= self._due_s:
            self._due_s = time.monotonic() + PLAIN_EVERY_S
            self.say(line)
            self._last = ""
            return
        self._last = line
