"""Mission time, and the grid of control ticks: t_k = t_0 + k T_s, without drift."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from mpc_cover.model.trajectory import SNAP_S

if TYPE_CHECKING:
    from mpc_cover.clock import Clock


class MissionClock:
    """Mission time runs while a plan is in force and stands still while the fleet waits for one.

    `period_s` is T_s; all times are of `clock` [s] unless they are called mission times.

    Attributes
    ----------
    tick : number of the current tick on the grid.
    due_s : when the next tick is due [s].
    """

    def __init__(self, clock: Clock, period_s: float, mission_time_s: float = 0.0) -> None:
        self._clock = clock
        self._period_s = period_s
        self._paused_s = mission_time_s
        self._start_s: float | None = None
        self.tick = 0
        self.due_s = clock.now()

    def now(self) -> float:
        """Return the mission time [s]; it never runs backwards."""
        return self.at(self._clock.now())

    def at(self, time_s: float) -> float:
        """Return the mission time [s] at a time of the clock."""
        return self._paused_s if self._start_s is None else self._paused_s + max(0.0, time_s - self._start_s)

    @property
    def origin_s(self) -> float:
        """Mission time 0 by the clock [s], while mission time runs."""
        return self.grid(0) - self._paused_s

    def grid(self, tick: int) -> float:
        """Return t_k by the clock [s]."""
        assert self._start_s is not None
        return self._start_s + tick * self._period_s

    def next_sample(self, time_s: float) -> float:
        """Return the first t_k by the clock that is not before a time of it [s]."""
        return self.grid(max(0, math.ceil((time_s - self.grid(0) - SNAP_S) / self._period_s)))

    def planned_start(self, tick: int) -> float:
        """Return the mission time of t_k [s]."""
        return self._paused_s + tick * self._period_s

    def pause(self) -> None:
        """Stop mission time."""
        self._paused_s, self._start_s = self.now(), None

    def start(self, start_s: float) -> None:
        """Let mission time run on from `start_s` of the clock, and start the grid there; the next tick is t_0."""
        self._start_s = start_s
        self.tick = -1

    def resume(self, origin_s: float) -> None:
        """Let mission time run as it did under an earlier controller: 0 at `origin_s` of the clock."""
        self._paused_s, self._start_s = 0.0, origin_s

    @property
    def running(self) -> bool:
        """Whether mission time runs."""
        return self._start_s is not None

    def next_tick(self) -> int:
        """Advance to the next tick that is not past; return how many were skipped."""
        following = self.tick + 1
        passed = math.floor((self._clock.now() - self.grid(0) + SNAP_S) / self._period_s)
        self.tick = max(following, passed)
        self.due_s = self.grid(self.tick)
        return self.tick - following

    def next_wait(self, wait_s: float) -> None:
        """Set the next tick off the grid, `wait_s` from now."""
        self.due_s = self._clock.now() + wait_s
