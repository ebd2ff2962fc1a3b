"""The controller's persistent folder: a lock, a counter of epochs, a secret, and the newest two checkpoints."""

from __future__ import annotations

import fcntl
import os
import secrets
import stat
from typing import TYPE_CHECKING, Self

from mpc_cover.errors import UserError

if TYPE_CHECKING:
    from pathlib import Path
    from types import TracebackType


SECRET_BYTES = 32
"""As many as HMAC-SHA256 makes use of."""
EPOCH_MAX = 2**52
"""Beyond it a number is no epoch: 2^53 is the last that a message can bear; plain choice of half of that."""


class StateError(UserError):
    """The folder cannot be used, or another controller uses it."""


def write_durably(path: Path, data: bytes, mode: int = 0o666) -> None:
    """Replace a file so that after a crash at any instant it holds either the old bytes or the new ones.

    A new one has the permissions `mode`, less those that the process's mask takes away.

    Raises
    ------
    OSError
        The disk is full, the folder was removed, ...; the old bytes stay.
    """
    temporary = path.with_name(f"{path.name}.tmp")
    with open(temporary, "wb", opener=lambda name, flags: os.open(name, flags, mode)) as file:
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
            path.mkdir(mode=0o700, parents=True, exist_ok=True)
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

    def next_epoch(self, seen: int = 0) -> tuple[int, str]:
        """Increment the counter durably; return this controller's epoch, and a message for the user, if any.

        The epoch is higher than all before it: than the counter, and than `seen`, that of the checkpoints, from which a
        missing or damaged counter is repaired. What agents have seen beyond that is learnt on the bus.

        Raises
        ------
        StateError
            The counter cannot be read or written.
        """
        counter = self.path / "epoch"
        try:
            there, last = counter.exists(), self._last_epoch(counter)
            text = ""
            if (last is None and (there or seen)) or (last is not None and last < seen):
                what = "is missing" if not there else "is damaged" if last is None else f"says {last}"
                text = f"{counter}: {what}: goes on after epoch {seen}, that of the checkpoints"
            last = max(last or 0, seen)
            self.set_epoch(last + 1)
        except OSError as error:
            raise StateError(f"{counter}: cannot be written: {error.strerror}") from None
        return last + 1, text

    def set_epoch(self, epoch: int) -> None:
        """Write the counter durably.

        Raises
        ------
        OSError
            It cannot be written.
        """
        write_durably(self.path / "epoch", f"{epoch}\n".encode("ascii"))

    def secret(self) -> bytes:
        """Return the secret of this folder, which only its owner may read; it is made where there is none.

        Raises
        ------
        StateError
            Others may read it, it is somebody else's, or it cannot be read or made.
        """
        file = self.path / "secret"
        try:
            if (kept := _read_secret(file)) is not None:
                return kept
            made = secrets.token_bytes(SECRET_BYTES)
            file.with_name("secret.tmp").unlink(missing_ok=True)
            write_durably(file, made.hex().encode("ascii") + b"\n", mode=0o600)
        except OSError as error:
            raise StateError(f"{file}: cannot be used: {error.strerror}") from None
        return made

    @staticmethod
    def _last_epoch(counter: Path) -> int | None:
        """Return the last epoch; None where the counter is missing or damaged: the end of line tells of a torn one."""
        try:
            text = counter.read_bytes().decode("ascii")
            last = int(text) if text.endswith("\n") else -1
        except (FileNotFoundError, ValueError):
            return None
        return last if 0 <= last <= EPOCH_MAX else None


def _read_secret(file: Path) -> bytes | None:
    """Return the secret in a file; None where it is missing or damaged."""
    try:
        number = os.open(file, os.O_RDONLY | os.O_NOFOLLOW)
    except FileNotFoundError:
        return None
    with os.fdopen(number, "rb") as opened:
        about = os.fstat(number)
        if about.st_uid != os.getuid() or stat.S_IMODE(about.st_mode) & 0o077:
            raise StateError(f"{file}: must be its owner's, who runs this, and nobody else may read it: chmod 600 it")
        try:
            kept = bytes.fromhex(opened.read(1000).decode("ascii"))
        except ValueError:
            return None
    return kept if len(kept) == SECRET_BYTES else None
