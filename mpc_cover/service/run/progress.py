"""Progress display while a mission is flown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

from mpc_cover.service.protocol.messages import Phase
from mpc_cover.view.progress import PLAIN_EVERY_S, QUIET_S, ProgressLine

if TYPE_CHECKING:
    from types import TracebackType

    from rich.console import Console

    from mpc_cover.service.protocol.messages import Status


def describe(status: Status) -> str:
    """Return a status as one line; coverage that is not complete is never shown as 100 %."""
    percent = (1000 * status.covered_count // max(1, status.cell_count)) / 10
    return (
        f"covered {percent:5.1f} %, {status.mission_time_s:5.1f} s, "
        f"step {status.step_ms:4.0f} ms, missed {status.deadline_misses}"
    )


class Progress:
    """Shows the newest status, and events above it, on stderr unless a console is given.

    Planning before the start may take minutes without a status: the line shows how long it has taken so far.
    """

    def __init__(
        self, console: Console | None = None, plain_every_s: float = PLAIN_EVERY_S, quiet_s: float = QUIET_S
    ) -> None:
        self._line = ProgressLine(console, leave=True, plain_every_s=plain_every_s, quiet_s=quiet_s)
        self._plans = False

    def __enter__(self) -> Self:
        """Start the display."""
        self._line.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the display, with the last line left behind."""
        self._line.__exit__(kind, error, trace)

    def say(self, text: str) -> None:
        """Write a permanent line."""
        self._line.say(text)

    def show(self, status: Status) -> None:
        """Show a status."""
        plans = status.phase is Phase.PLANNING
        if plans != self._plans:
            self._plans = plans
            self._line.begin("plans while everyone is at rest" if plans else "")
        if not plans:
            self._line.show(describe(status), status.covered_count / max(1, status.cell_count))
