"""What a command that lasts says meanwhile, on stderr: a line that is renewed on a terminal, plain lines elsewhere."""

from __future__ import annotations

import time
from threading import Event, RLock, Thread
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.text import Text

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

    from rich.status import Status

QUIET_S = 2.0
"""How long nothing is written where there is no terminal: what is done by then needs none [s]. A plain choice."""
PLAIN_EVERY_S = 5.0
"""How often a plain line is written after that [s]. A plain choice."""
POLL_S = 0.5
"""How often the time on a terminal is renewed, at most, while there is no news [s]. A plain choice."""
BAR = 20
"""Characters of a bar."""


class ProgressLine:
    """A line of what is being done, how long it has taken, and the newest of it; a thread keeps the time going.

    Parameters
    ----------
    console : where to; None for stderr.
    leave : whether the newest line is left behind at the end.
    plain_every_s, quiet_s : see the constants of these names [s].
    monotonic : seconds of a clock.
    """

    def __init__(
        self,
        console: Console | None = None,
        *,
        leave: bool = False,
        plain_every_s: float = PLAIN_EVERY_S,
        quiet_s: float = QUIET_S,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self._console = console or Console(stderr=True)
        self._leave, self._plain_every_s, self._monotonic = leave, plain_every_s, monotonic
        self._lock, self._over = RLock(), Event()
        self._thread = Thread(target=self._poll, name="progress", daemon=True)
        self._spinner: Status | None = None
        self._what, self._text = "", ""
        self._part: float | None = None
        self._limit_s: float | None = None
        self._since = monotonic()
        self._due_s = self._since + quiet_s
        self._written = ""

    def __enter__(self) -> Self:
        """Start the display."""
        if self._console.is_terminal:
            self._spinner = self._console.status("")
            self._spinner.start()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the display."""
        self._over.set()
        self._thread.join()
        if self._spinner is not None:
            self._spinner.stop()
            self._spinner = None
        if self._leave and self._text and (line := self._line(timed=False)) != self._written:
            self.say(line)

    def begin(self, what: str, limit_s: float | None = None) -> None:
        """Name what is done from now on; its time starts at 0, and may have a limit [s]."""
        with self._lock:
            self._what, self._text, self._part, self._limit_s = what, "", None, limit_s
            self._since = self._monotonic()
            self._renew()

    def show(self, text: str, part: float | None = None) -> None:
        """Show the newest of it, and which part of all is done, 0 to 1, as a bar."""
        with self._lock:
            self._text, self._part = text, part
            self._renew()

    def say(self, text: str) -> None:
        """Write a line that stays."""
        with self._lock:
            self._console.print(text, highlight=False, markup=False, soft_wrap=not self._console.is_terminal)

    def _line(self, *, timed: bool = True) -> str:
        what = self._what
        if timed and what:
            limit = f" of {self._limit_s:g}" if self._limit_s is not None else ""
            what += f" ({self._monotonic() - self._since:.0f}{limit} s)"
        return ": ".join(part for part in (what, self._text) if part)

    def _renew(self) -> None:
        """Show the line as it is now, where that is due."""
        line = self._line()
        if self._spinner is not None:
            self._spinner.update(Text(self._bar() + line))
        elif line and self._monotonic() >= self._due_s:
            self._due_s = self._monotonic() + self._plain_every_s
            self.say(line)
            self._written = self._line(timed=False)

    def _bar(self) -> str:
        if self._part is None:
            return ""
        filled = min(BAR, int(BAR * self._part))
        full, empty = "█░" if self._console.encoding.startswith("utf") else "#-"
        return f"{full * filled}{empty * (BAR - filled)} "

    def _poll(self) -> None:
        while not self._over.wait(min(POLL_S, self._plain_every_s)):
            with self._lock:
                self._renew()
