"""Virtual time: events in their order, and processes that run one at a time, each until it waits.

A process is a thread that is handed the turn, and hands it back whenever it waits for its clock: the code of a daemon
runs unchanged, may be suspended in the middle of a computation, and the same events happen in the same order each time.
"""

from __future__ import annotations

import heapq
import itertools
from threading import Lock, Thread
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable


class VirtualTime:
    """The events to come; `now_s` is the present [s], `wall_step_s` by how much whoever runs has a wrong wall clock."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.wall_step_s = 0.0
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._number = itertools.count()

    def at(self, time_s: float, action: Callable[[], None]) -> None:
        """Call `action` at `time_s` [s], after those that were planned for it before."""
        heapq.heappush(self._events, (max(time_s, self.now_s), next(self._number), action))

    def run(self, until_s: float, over: Callable[[], bool]) -> None:
        """Let time pass until `until_s` [s], or until it is over."""
        while self._events and self._events[0][0] <= until_s and not over():
            time_s, _, action = heapq.heappop(self._events)
            self.now_s = time_s
            action()


class KilledError(BaseException):
    """Raised in a killed process wherever it next touches its world; no handler of Exception catches it."""


class Turn:
    """A function in a thread of its own that runs only when it is given the turn, until it gives it back."""

    def __init__(self, body: Callable[[], None]) -> None:
        self._mine, self._others = Lock(), Lock()
        self._mine.acquire()
        self._others.acquire()
        self._body, self.over = body, False
        Thread(target=self._run, daemon=True).start()

    def give(self) -> None:
        """Let it run until it waits or ends."""
        if self.over:
            return
        self._mine.release()
        self._others.acquire()

    def wait(self) -> None:
        """Give the turn back; called in the thread itself."""
        self._others.release()
        self._mine.acquire()

    def _run(self) -> None:
        self._mine.acquire()
        try:
            self._body()
        finally:
            self.over = True
            self._others.release()
