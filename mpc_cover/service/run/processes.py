"""Child processes that never outlive their parent."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from typing import IO, TYPE_CHECKING

from mpc_cover.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

GRACE_S = 5.0
"""How long a process may take to end after SIGTERM [s]."""
PORTS = range(20_000, 32_000)
"""Below the ephemeral ports of the system, so that none is taken between choice and use."""
_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


class Child:
    """One `mpc-cover` process, its output in a log file.

    It holds the reading end of a pipe whose other end is the parent's: if the parent dies, even by SIGKILL, it ends
    too. It has a session of its own, so that Ctrl-C reaches only the parent, which then ends its children in order.
    """

    def __init__(self, name: str, arguments: Sequence[str], log: Path) -> None:
        self.name = name
        self.log = log
        command = [sys.executable, "-m", "mpc_cover", *arguments, "--with-parent"]
        try:
            with log.open("ab") as output:
                self._process = subprocess.Popen(  # noqa: S603 - our own command
                    command,
                    stdin=subprocess.PIPE,
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,
                    env={**_ONE_THREAD, **os.environ},
                )
        except OSError as error:
            raise UserError(f"{name}: cannot be started: {error}") from None

    @property
    def pid(self) -> int:
        """The process id."""
        return self._process.pid

    @property
    def exit_status(self) -> int | None:
        """None while it runs; negative when a signal ended it."""
        return self._process.poll()

    def kill(self) -> None:
        """End it at once, as by `kill -9`."""
        self._process.kill()

    def terminate(self) -> None:
        """Send SIGTERM, and close the pipe."""
        if self.exit_status is None:
            self._process.terminate()
        self._close_pipe()

    def wait_or_kill(self, deadline_s: float) -> None:
        """Wait for its end until `deadline_s` of `time.monotonic`, then kill it."""
        try:
            self._process.wait(max(0.0, deadline_s - time.monotonic()))
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._close_pipe()

    def last_lines(self, count: int = 5) -> str:
        """Return the last lines of its log."""
        try:
            return "\n".join(self.log.read_text(encoding="utf-8", errors="replace").splitlines()[-count:])
        except OSError:
            return ""

    def _close_pipe(self) -> None:
        pipe: IO[bytes] | None = self._process.stdin
        if pipe is not None and not pipe.closed:
            pipe.close()


def terminate_all(children: Iterable[Child]) -> None:
    """Terminate all, and kill those that do not end in time."""
    children = list(children)
    for child in children:
        child.terminate()
    deadline_s = time.monotonic() + GRACE_S
    for child in children:
        child.wait_or_kill(deadline_s)


def free_port(taken: Iterable[int] = ()) -> int:
    """Return a free port of the loopback interface, none of those `taken`.

    Raises
    ------
    UserError
        There is none.
    """
    taken = set(taken)
    start = (os.getpid() * 97 + time.monotonic_ns() // 1000) % len(PORTS)
    for offset in range(len(PORTS)):
        port = PORTS[(start + offset) % len(PORTS)]
        if port in taken:
            continue
        with socket.socket() as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
            return port
    raise UserError("network: no port of the loopback interface is free")
