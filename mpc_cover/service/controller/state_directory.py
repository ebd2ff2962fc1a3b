"""The controller's persistent folder: a lock, a counter of epochs, and the newest two checkpoints."""

from __future__ import annotations

import fcntl
import os
from typing import TYPE_CHECKING, Self

from mpc_cover.errors import UserError

if TYPE_CHECKING:
    from pathlib import Path
    from types import TracebackType


class StateError(UserError):
    """The folder cannot be used, or another controller uses it."""


def write_durably(path: Path, data: bytes) -> None:
    """Replace a file so that after a crash at any instant it holds either the old bytes or the new ones.

    Raises
    ------
    OSError
        The disk is full, the folder was removed, ...; the old bytes stay.
    """
    temporary = path.with_name(f"{path.name}.tmp")
    with temporary.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    temporary.replace(path)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


class StateDirectory:
    """A locked state directory; the system releases the lock when the process ends, however it ends."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            path.mkdir(parents=True, exist_ok=True)
            self._lock = (path / "lock").open("ab")
        except OSError as error:
            raise StateError(f"state directory {path}: cannot be used: {error.strerror}") from None
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._lock.close()
            raise StateError(
                f"state directory {path}: another controller uses it: end that one, or give another --state-dir"
            ) from None

    def __enter__(self) -> Self:
        """Return itself, locked."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Unlock."""
        self.close()

    def close(self) -> None:
        """Unlock; may be called twice."""
        self._lock.close()

    def next_epoch(self) -> int:
        """Increment the counter durably, and return this controller's epoch: higher than all before it.

        Raises
        ------
        StateError
            The counter is damaged or cannot be written.
        """
        counter = self.path / "epoch"
        try:
            epoch = int(counter.read_text(encoding="ascii")) + 1 if counter.exists() else 1
            write_durably(counter, f"{epoch}\n".encode("ascii"))
        except ValueError:
            raise StateError(f"{counter}: is damaged: must hold the number of the last epoch") from None
        except OSError as error:
            raise StateError(f"{counter}: cannot be written: {error.strerror}") from None
        return epoch
