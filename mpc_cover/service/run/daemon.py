"""The main loop of the daemons: startup, a tick whenever one is due, shutdown; signals end it cleanly."""

from __future__ import annotations

import math
import signal
from threading import Event
from typing import TYPE_CHECKING, Protocol, Self

from mpc_cover.exit_status import exit_status

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType, TracebackType

    from mpc_cover.clock import Clock

TERMINATED = 143
"""Exit status of another process's child after SIGTERM: 128 + SIGTERM, as if it had not been handled."""


class Participant(Protocol):
    """A process that can be run as a daemon, or tick by tick in a simulation."""

    @property
    def next_time(self) -> float:
        """When the next tick is due [s]."""
        ...

    @property
    def done(self) -> bool:
        """Whether there is nothing left to do."""
        ...

    def startup(self) -> None:
        """Announce presence."""
        ...

    def tick(self) -> None:
        """Do what is due now."""
        ...

    def shutdown(self) -> None:
        """Release resources and end the records."""
        ...


class Signals:
    """Turns SIGINT and SIGTERM into `stop`, which clocks wait on; `received` is the first of them, or 0.

    Handlers only set an event: nothing is interrupted in the middle of a tick, unless Ctrl-C comes twice. A `child` is
    one of a demo's processes, which must tell an end by SIGTERM from one of its own.
    """

    def __init__(self, *, child: bool = False) -> None:
        self.stop = Event()
        self.received = 0
        self._child = child
        self._before: dict[int, object] = {}

    def __enter__(self) -> Self:
        """Install the signal handlers."""
        for number in (signal.SIGINT, signal.SIGTERM):
            self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Restore the signal handlers."""
        for number, handler in self._before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]

    @property
    def exit_status(self) -> int:
        """That of a daemon: 130 after Ctrl-C; 0 after SIGTERM, which is a clean end, and when there was no signal."""
        if self.received == signal.SIGTERM and self._child:
            return TERMINATED
        return exit_status(interrupted=self.received == signal.SIGINT)

    def _note(self, number: int, frame: FrameType | None) -> None:  # noqa: ARG002 - the signal module's signature
        if self.received and number == signal.SIGINT:
            raise KeyboardInterrupt  # the second Ctrl-C ends at once
        self.received = self.received or number
        self.stop.set()


def run(
    participant: Participant,
    clock: Clock,
    stop: Event,
    after_tick: Callable[[], None] | None = None,
    look_s: float = math.inf,
    idle: Callable[[float], None] | None = None,
) -> None:
    """Run until it is done or `stop` is set; `shutdown` is called whatever happens.

    Before it waits until a time of the clock [s], `idle` is called with it. When the next tick is due is looked up
    every `look_s` of the clock [s]: a command may make it due at once.
    """
    try:
        participant.startup()
        while not participant.done:
            until_s = min(participant.next_time, clock.now() + look_s)
            if idle is not None:
                idle(until_s)
            if not clock.wait_until(until_s, stop):
                break
            if participant.next_time > clock.now():
                continue
            participant.tick()
            if after_tick:
                after_tick()
    finally:
        participant.shutdown()
