"""Progress display while a mission is flown: a line that is updated on a terminal, plain lines elsewhere."""

from __future__ import annotations

import time
from threading import Event, Lock, Thread
from typing import TYPE_CHECKING, Self

from mpc_cover.service.protocol.messages import Phase

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

    from rich.console import Console
    from rich.status import Status as Spinner

    from mpc_cover.service.protocol.messages import Status

PLAIN_EVERY_S = 2.0
"""How often a plain line is written [s]."""
PLANS_EVERY_S = 5.0
"""How often a plain line is written during planning, which sends no status [s]."""
POLL_S = 0.5
"""How often the duration of planning is updated [s]."""
BAR = 20


def describe(status: Status) -> str:
    """Return a status as one line; coverage that is not complete is never shown as 100 %."""
    percent = (1000 * status.covered_count // max(1, status.cell_count)) / 10
    return (
        f"covered {percent:5.1f} %, {status.mission_time_s:5.1f} s, "
        f"step {status.step_ms:4.0f} ms, missed {status.deadline_misses}"
    )


class Progress:
    """Shows the newest status, and events above it.

    Planning before the start may take minutes without a status: a thread shows how long it has taken so far.
    """

    def __init__(
        self, console: Console, plans_every_s: float = PLANS_EVERY_S, monotonic: Callable[[], float] = time.monotonic
    ) -> None:
        self._console, self._plans_every_s, self._monotonic = console, plans_every_s, monotonic
        self._lock, self._over = Lock(), Event()
        self._watch = Thread(target=self._poll, name="progress", daemon=True)
        self._plans_since: float | None = None
        self._spinner: Spinner | None = None
        self._due_s = 0.0
        self._last = ""

    def __enter__(self) -> Self:
        """Start the display."""
        if self._console.is_terminal:
            self._spinner = self._console.status("starts")
            self._spinner.start()
        self._watch.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the display, with the last line left on the terminal."""
        self._over.set()
        self._watch.join()
        if self._spinner is not None:
            self._spinner.stop()
            self._spinner = None
        if self._last:
            self._console.print(self._last, highlight=False, markup=False)

    def say(self, text: str) -> None:
        """Write a permanent line."""
        self._console.print(text, highlight=False, markup=False, soft_wrap=True)

    def show(self, status: Status) -> None:
        """Show a status."""
        with self._lock:
            if status.phase is Phase.PLANNING:
                if self._plans_since is None:
                    self._plans_since, self._due_s = self._monotonic(), 0.0
                self._show_planning(self._plans_since)
                return
            self._plans_since = None
            self._show(status)

    def _show(self, status: Status) -> None:
        line = describe(status)
        if self._spinner is not None:
            filled = BAR * status.covered_count // max(1, status.cell_count)
            full, empty = "█░" if self._console.encoding.startswith("utf") else "#-"
            self._spinner.update(f"{full * filled}{empty * (BAR - filled)} {line}")
        elif line != self._last and self._monotonic() >= self._due_s:
            self._due_s = self._monotonic() + PLAIN_EVERY_S
            self.say(line)
            self._last = ""
            return
        self._last = line

    def _show_planning(self, since: float) -> None:
        """Show how long planning has taken since a time [s]."""
        now = self._monotonic()
        line = f"plans while everyone is at rest: {now - since:.0f} s so far"
        if self._spinner is not None:
            self._spinner.update(line)
        elif now >= self._due_s:
            self._due_s = now + self._plans_every_s
            self.say(line)

    def _poll(self) -> None:
        while not self._over.wait(min(POLL_S, self._plans_every_s)):
            with self._lock:
                if self._plans_since is not None:
                    self._show_planning(self._plans_since)
