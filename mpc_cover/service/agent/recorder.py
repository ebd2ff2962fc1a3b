"""An agent's own record of its exact motion, written as it moves.

One JSON value per line: a header, then the pieces of the motion, each with the input that is held until the
next piece begins. At each report the state reached is marked by a piece without input: the next piece begins at the
same instant and replaces it, unless there is none. Only the last line can be incomplete, if the process was killed;
it is dropped when reading.
"""

from __future__ import annotations

from typing import IO, TYPE_CHECKING, Protocol

import msgspec
import numpy as np

from mpc_cover.errors import UnreadableFileError, UserError
from mpc_cover.service.protocol.messages import PlanRef  # noqa: TC001 - msgspec reads it

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from mpc_cover.arrays import FloatArray


class Header(msgspec.Struct, frozen=True):
    """The agent that wrote the record; `speed` is how many seconds of `time_s` pass in a second."""

    agent: str
    instance: str
    mission: str
    speed: float = 1.0
    schema: int = 1


class Piece(msgspec.Struct, frozen=True, array_like=True):
    """State at `time_s` of the agent's clock, and the input held from there on; (d,) each."""

    time_s: float
    position: list[float]
    velocity: list[float]
    input: list[float]
    plan: PlanRef | None = None


class Recorder(Protocol):
    """Records the pieces of a motion."""

    def piece(
        self, time_s: float, position: FloatArray, velocity: FloatArray, force: FloatArray, plan: PlanRef | None
    ) -> None:
        """Record a piece."""
        ...

    def mark(self, time_s: float, position: FloatArray, velocity: FloatArray) -> None:
        """Record the state reached; if it is the last one, the record ends there."""
        ...

    def close(self, time_s: float, position: FloatArray, velocity: FloatArray) -> None:
        """Record the last state."""
        ...


class MemoryRecorder:
    """Keeps the pieces in memory."""

    def __init__(self) -> None:
        self.pieces: list[Piece] = []

    def piece(
        self, time_s: float, position: FloatArray, velocity: FloatArray, force: FloatArray, plan: PlanRef | None
    ) -> None:
        """Record a piece."""
        self.pieces.append(Piece(time_s, position.tolist(), velocity.tolist(), force.tolist(), plan))

    def mark(self, time_s: float, position: FloatArray, velocity: FloatArray) -> None:
        """Record the state reached."""
        self.piece(time_s, position, velocity, np.zeros_like(velocity), None)

    close = mark


class FileRecorder:
    """Appends the pieces to a file, each line unbuffered: killing the process loses none.

    A write error ends the record and is reported once; the agent flies on.
    """

    def __init__(self, path: Path, header: Header, say: Callable[[str], None]) -> None:
        self._path = path
        self._say = say
        try:
            self._file: IO[bytes] | None = path.open("wb", buffering=0)
        except OSError as error:
            raise UserError(f"record {path}: cannot be written: {error.strerror}") from None
        self._write(header)

    def piece(
        self, time_s: float, position: FloatArray, velocity: FloatArray, force: FloatArray, plan: PlanRef | None
    ) -> None:
        """Write a piece."""
        self._write(Piece(time_s, position.tolist(), velocity.tolist(), force.tolist(), plan))

    def mark(self, time_s: float, position: FloatArray, velocity: FloatArray) -> None:
        """Write the state reached."""
        self.piece(time_s, position, velocity, np.zeros_like(velocity), None)

    def close(self, time_s: float, position: FloatArray, velocity: FloatArray) -> None:
        """Write the last state and close the file."""
        self.mark(time_s, position, velocity)
        if self._file is not None:
            self._file.close()
            self._file = None

    def _write(self, line: Header | Piece) -> None:
        if self._file is None:
            return
        try:
            self._file.write(msgspec.json.encode(line) + b"\n")
        except OSError as error:
            self._say(f"record {self._path}: cannot be written any more: {error.strerror}")
            self._file.close()
            self._file = None


def read_record(path: Path) -> tuple[Header, list[Piece]]:
    """Read what `FileRecorder` wrote, without an incomplete last line.

    Raises
    ------
    UnreadableFileError
        Missing, or not such a record.
    """
    try:
        lines = path.read_bytes().split(b"\n")
    except OSError as error:
        raise UnreadableFileError(f"record {path}: cannot be read: {error.strerror}") from None
    try:
        header = msgspec.json.decode(lines[0], type=Header)
        pieces = [msgspec.json.decode(line, type=Piece) for line in lines[1:-1]]
    except msgspec.MsgspecError as error:
        raise UnreadableFileError(f"record {path}: is not an agent's record: {error}") from None
    return header, pieces
