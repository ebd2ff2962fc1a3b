"""A peer's stop-watch: it passes on iterates as they come, and is paused while they are judged."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from mpc_cover.planning.budget import Budget
from mpc_cover.studies.verdict import Verdict, judge

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray
    from mpc_cover.studies.case import Case


class Enough(Exception):  # noqa: N818 - no error: ends a solver that has no other way to be stopped
    """The time is up, or no better result is possible."""


@dataclass(frozen=True, eq=False)
class Sighting:
    """An iterate: its time [s], its decision vector, and the verdict on it."""

    time_s: float
    x: FloatArray
    verdict: Verdict


@dataclass(frozen=True, eq=False)
class Answer:
    """A peer's answer.

    Attributes
    ----------
    x : its last decision vector; an earlier iterate may be better.
    iterations : in the peer's own counting (steps of its SQP, or of its interior-point method).
    status : its own message about why it ended.
    time_s : on its stop-watch.
    """

    x: FloatArray
    iterations: int
    status: str
    time_s: float


class Peer(Protocol):
    """Solves a case from a decision vector; calls `watch.begin` once it is set up, and `watch.see` as it goes."""

    def __call__(self, case: Case, x: FloatArray, watch: Watch) -> Answer:
        """Return the answer; may raise any exception, which is then shown in its row of the table."""
        ...


class Watch:
    """Measures one peer.

    Setting up (building symbolic graphs, compiling) is timed apart from solving; judging iterates is not
    counted at all. All peers are stopped by the same rule: when the time is up, or when an iterate covers
    everything and holds along the continuous path, as then no J can be lower.

    Parameters
    ----------
    case : the problem.
    limit_s : time for solving.
    report : called with the seconds that setting up took, once solving begins, and then with each iterate.
    clock : monotonic seconds, of wall time or of this process's processor time.
    """

    def __init__(
        self,
        case: Case,
        limit_s: float,
        report: Callable[[float | Sighting], None],
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._case, self._limit_s, self._report, self._clock = case, limit_s, report, clock
        self._created = self._origin = clock()
        self.complete = False

    def begin(self, x: FloatArray | None = None) -> None:
        """Start the watch: the time before was for setting up. `x` is the peer's start, if it is given."""
        self._origin = self._clock()
        self._report(self._origin - self._created)
        if x is not None:
            self.see(x)

    @property
    def elapsed_s(self) -> float:
        """Seconds since `begin`, without those that judging took."""
        return self._clock() - self._origin

    @property
    def budget(self) -> Budget:
        """The remaining time; judging postpones its end.

        Unlimited where the watch measures processor time, whose end is not known in advance: `see` returns when to
        stop.
        """
        if self._clock is time.process_time:
            return Budget.unlimited()
        return Budget.wall_clock(self._limit_s - self.elapsed_s)

    @property
    def enough(self) -> bool:
        """Whether to stop."""
        return self.complete or self.elapsed_s >= self._limit_s

    def see(self, x: FloatArray) -> bool:
        """Judge an iterate and pass it on; return whether to stop."""
        stopped = self._clock()
        sighting = Sighting(stopped - self._origin, x.copy(), judge(self._case, x))
        self.complete = self.complete or sighting.verdict.complete
        self._report(sighting)
        self._origin += self._clock() - stopped
        return self.enough

    def answer(self, x: FloatArray, iterations: int, status: str) -> Answer:
        """Return the answer as of now, after a last look at it."""
        elapsed = self.elapsed_s
        self.see(x)
        return Answer(x, iterations, status, elapsed)
