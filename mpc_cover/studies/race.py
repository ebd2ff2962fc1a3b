"""Runs one peer at a time, each in a process of its own: its failure does not stop the benchmark.

A process gives every peer the same fresh start, can be stopped if it hangs in native code, and turns a crash into a
row of the table.
"""

from __future__ import annotations

import os
import tempfile
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

from mpc_cover.mission.load import mission_from_json
from mpc_cover.studies.case import make_case
from mpc_cover.studies.peers.registry import OPTIONAL, PEERS
from mpc_cover.studies.watch import Answer, Sighting, Watch

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from multiprocessing.connection import Connection

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.studies.verdict import Verdict

START_S = 30.0
"""Time for a process to start and a peer to set up, on top of the time limit [s]."""
GRACE_S = 5.0
"""Time for which a peer may be silent after its time is up; then it is stopped [s]."""

PATIENCE = 10.0
"""Largest ratio of wall time to processor time, on a machine with other work."""
END_S = 0.5
"""Time for a process to end by itself, so that its exit status is its own [s]."""

_ONE_THREAD = {
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"),
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
}
"""Libraries of dense algebra, and JAX, read these once, when they are loaded."""


@dataclass(frozen=True)
class Failure:
    """Why a peer has no answer."""

    reason: str


@dataclass(eq=False)
class Run:
    """The run of one peer.

    Attributes
    ----------
    name : the peer's.
    setup_s : until it began to solve.
    time_s : of solving, by its own stop-watch; until the last iterate where it gave no answer.
    seen : the time of each iterate [s], and the verdict on it.
    best : the iterate that counts: of those that hold at the samples the one with the least J, or the least violated.
    flyable : of those that hold along the continuous path, the one with the least J.
    iterations : in the peer's counting.
    status : why it ended.
    answered : whether it ended by itself.
    """

    name: str
    setup_s: float = 0.0
    time_s: float = 0.0
    seen: list[tuple[float, Verdict]] = field(default_factory=list)
    best: Sighting | None = None
    flyable: Sighting | None = None
    iterations: int = 0
    status: str = ""
    answered: bool = False

    def take(self, message: object) -> None:
        """Take in a message of the peer's process."""
        if isinstance(message, Sighting):
            self._see(message)
        elif isinstance(message, Answer):
            self.time_s, self.iterations, self.status = message.time_s, message.iterations, message.status
            self.answered = True
        elif isinstance(message, Failure):
            self.status = message.reason
        elif isinstance(message, float):
            self.setup_s = message

    def _see(self, sighting: Sighting) -> None:
        self.seen.append((sighting.time_s, sighting.verdict))
        self.time_s = max(self.time_s, sighting.time_s)
        if self.best is None or _rank(sighting) < _rank(self.best):
            self.best = sighting
        if sighting.verdict.holds and (self.flyable is None or sighting.verdict.cost < self.flyable.verdict.cost):
            self.flyable = sighting


@dataclass(frozen=True)
class Limit:
    """The time limit for a peer to solve [s], of wall time or, on a machine with other work, of processor time."""

    seconds: float
    cpu_time: bool = False

    @property
    def clock(self) -> Callable[[], float]:
        """The clock on which it is measured; each peer keeps to one thread."""
        return time.process_time if self.cpu_time else time.perf_counter

    def wall_s(self, spent_s: float) -> float:
        """Return the wall time that may pass until it is reached, once so much is spent [s]."""
        left = max(0.0, self.seconds - spent_s)
        return PATIENCE * left if self.cpu_time else left


def race(
    name: str, mission: Mission, x: FloatArray, limit: Limit, on_progress: Callable[[Run], None] = lambda _: None
) -> Run:
    """Let a peer solve a mission's case from the decision vector `x`; never raises on account of the peer.

    `on_progress` is called as iterates come in.
    """
    run = Run(name)
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        context = get_context("spawn")
        receiving, sending = context.Pipe(duplex=False)
        arguments = (sending, name, mission.to_json(), x, limit, str(log))
        process = context.Process(target=compete, args=arguments, daemon=True)
        with _one_thread():
            process.start()
        sending.close()
        try:
            _receive(run, receiving, limit, on_progress)
        finally:
            process.join(END_S)
            process.kill()
            process.join()
            receiving.close()
        if not run.status:
            run.status = f"died (exit status {process.exitcode}){_last_line(log)}"
    return run


def _receive(run: Run, receiving: Connection, limit: Limit, on_progress: Callable[[Run], None]) -> None:
    """Take in messages until the peer has answered, died, or been silent for too long."""
    patience = time.monotonic() + limit.wall_s(0.0) + START_S
    while not (run.answered or run.status):
        if not receiving.poll(max(0.0, patience - time.monotonic())):
            run.status, run.time_s = "stopped: it did not heed the time limit", max(run.time_s, limit.seconds)
            return
        try:
            message = receiving.recv()
        except (EOFError, OSError):
            return
        run.take(message)
        patience = time.monotonic() + limit.wall_s(run.time_s) + GRACE_S
        on_progress(run)


def compete(connection: Connection, name: str, mission: str, x: FloatArray, limit: Limit, log: str) -> None:
    """Run one peer in this process; the output of native code goes to the file `log`."""
    target = os.open(log, os.O_WRONLY | os.O_CREAT, 0o600)
    os.dup2(target, 1)
    os.dup2(target, 2)
    connection.send(solved(name, mission, x, limit, connection.send))
    connection.close()


def solved(
    name: str, mission: str, x: FloatArray, limit: Limit, send: Callable[[float | Sighting], None]
) -> Answer | Failure:
    """Let a peer solve; return its answer, or why it failed."""
    try:
        peer = PEERS[name].load()
        case = make_case(mission_from_json(mission, "the benchmark's mission"))
        return peer(case, x, Watch(case, limit.seconds, send, limit.clock))
    except ModuleNotFoundError as error:
        remedy = OPTIONAL.get(error.name or "")
        return Failure(f"not installed: {remedy}" if remedy else f"failed: {error}")
    except NotImplementedError as error:
        return Failure(f"cannot solve this mission: {error}")
    except Exception as error:  # noqa: BLE001 - a peer may fail in any way, and its row says which
        return Failure(f"failed: {type(error).__name__}: {' '.join(str(error).split())[:200]}")


@contextmanager
def _one_thread() -> Iterator[None]:
    """Let dense algebra use one thread in processes started now.

    The matrices here are small. With a thread per core, SLSQP and IPOPT with its exact Hessian took two to ten times
    as long as soon as anything else ran on the machine, and ours one and a half times as long.
    """
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(_ONE_THREAD)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _rank(sighting: Sighting) -> tuple[bool, float, bool]:
    verdict = sighting.verdict
    return (not verdict.holds_sampled, verdict.cost if verdict.holds_sampled else verdict.sampled, not verdict.holds)


def _last_line(log: Path) -> str:
    try:
        lines = log.read_text(encoding="utf-8", errors="replace").split("\n")
    except OSError:
        return ""
    written = [line.strip() for line in lines if line.strip()]
    return f": {written[-1][:120]}" if written else ""
