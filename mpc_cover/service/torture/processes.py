"""Simulated processes: a daemon's main loop on virtual time, which can be killed, stopped, continued and slowed."""

from __future__ import annotations

import random
import traceback
from threading import Event
from typing import TYPE_CHECKING

from mpc_cover.errors import UserError
from mpc_cover.service.run.daemon import run
from mpc_cover.service.torture.virtual_time import KilledError, Turn

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.service.run.daemon import Participant
    from mpc_cover.service.torture.virtual_time import VirtualTime


class ProcessClock:
    """The clock of one process: monotonic, with an origin and a rate of its own; the wall clock is `step_s` off.

    Whoever asks for the time of a killed process gets KilledError.
    """

    def __init__(self, process: Process, origin_s: float, rate: float = 1.0) -> None:
        self._process, self._origin_s, self._rate = process, origin_s, rate
        self._latest_s = -float("inf")
        self.step_s = 0.0

    def now(self) -> float:
        """Return the monotonic time [s]."""
        self._process.check_alive()
        self._latest_s = max(self._latest_s, self.at(self._process.time.now_s))
        return self._latest_s

    def at(self, world_s: float) -> float:
        """Return the clock's time at a virtual time [s]."""
        return self._origin_s + self._rate * world_s

    def world_s(self, time_s: float) -> float:
        """Return the virtual time at a time of the clock [s]."""
        return (time_s - self._origin_s) / self._rate

    def wait_until(self, time_s: float, stop: Event) -> bool:
        """Wait until `time_s`; return False when `stop` is set."""
        self._process.wait_until(self.world_s(time_s))
        self._latest_s = max(self._latest_s, time_s)  # what rounding of origin and rate leaves out
        return not stop.is_set()


class Process:
    """A process of the simulated world.

    Parameters
    ----------
    name : whose it is, as faults name it.
    origin_s, rate : of its clock.
    seed : of what is random in its delays.

    Attributes
    ----------
    participant : what runs in it, from its start on.
    alive : whether it runs, or would if it were not stopped.
    stopped : whether it is stopped (SIGSTOP).
    ended : whether it ended by itself.
    crash : the exception that ended it, as text; empty if none did.
    unable : why it could not start; empty if it could.
    lag_s : its ticks come late by up to this [s].
    """

    def __init__(self, name: str, time: VirtualTime, origin_s: float, rate: float = 1.0, seed: str = "") -> None:
        self.name, self.time = name, time
        self.clock = ProcessClock(self, origin_s, rate)
        self.participant: Participant | None = None
        self.alive, self.stopped, self.ended = True, False, False
        self.crash = self.unable = ""
        self.lag_s = 0.0
        self.on_end: list[Callable[[], None]] = []
        self._random = random.Random(f"{seed}/{name}/lag")  # noqa: S311 - reproducible, no secret
        self._turn: Turn | None = None
        self._held: list[Callable[[], None]] = []

    def start(
        self, make: Callable[[], Participant], look_s: float = float("inf"), idle: Callable[[float], None] | None = None
    ) -> None:
        """Start the main loop of a daemon; `make` returns what runs in it."""

        def body() -> None:
            try:
                try:
                    self.participant = make()
                except UserError as error:
                    self.unable = str(error)
                    return
                more = getattr(self.participant, "idle", None) if idle is None else idle
                run(self.participant, self.clock, Event(), None, look_s, more)
            except KilledError:
                pass
            except BaseException as error:  # noqa: BLE001 - whatever ends a process is a finding
                self.crash = "".join(traceback.format_exception(error)[-3:])
            finally:
                self._end()

        self._turn = Turn(body)
        self._run()

    def wait_until(self, world_s: float) -> None:
        """Wait in this process until a virtual time [s]; called from its own thread."""
        self.check_alive()
        late_s = self._random.uniform(0.0, self.lag_s) if self.lag_s else 0.0
        due_s = world_s + late_s
        if due_s <= self.time.now_s and not self.stopped:
            return
        assert self._turn is not None
        self.time.at(due_s, self._wake)
        self._turn.wait()
        self.check_alive()

    def check_alive(self) -> None:
        """Raise KilledError in a process that was killed."""
        if not self.alive and not self.ended:
            raise KilledError

    def when_running(self, action: Callable[[], None]) -> None:
        """Do something in this process: at once, or as soon as it is continued."""
        if self.stopped:
            self._held.append(action)
        else:
            action()

    def stop(self) -> None:
        """Stop it: nothing of it runs until it is continued."""
        self.stopped = True

    def proceed(self) -> None:
        """Continue it: what has waited for it happens now."""
        self.stopped = False
        held, self._held = self._held, []
        for action in held:
            action()

    def kill(self) -> None:
        """End it as SIGKILL does: it does nothing more."""
        if not self.alive:
            return
        self.alive = False
        for action in self.on_end:
            action()
        self._held = []
        self._run()

    def die(self) -> None:
        """End it as SIGKILL does, in the middle of what it does: called in its own thread."""
        self.alive = False
        for action in self.on_end:
            action()
        raise KilledError

    def _wake(self) -> None:
        if self.alive:
            self.when_running(self._run)

    def _run(self) -> None:
        """Give it the turn until it waits."""
        if self._turn is not None:
            self.time.wall_step_s = self.clock.step_s
            self._turn.give()
            self.time.wall_step_s = 0.0

    def _end(self) -> None:
        if not self.alive:
            return
        self.alive, self.ended = False, True
        for action in self.on_end:
            action()
