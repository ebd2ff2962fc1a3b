"""What each control step took and which rung it stood on; one JSON value a line when kept in a file."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import msgspec

from mpc_cover.errors import UnreadableFileError, UserError

if TYPE_CHECKING:
    from pathlib import Path


KEPT = 100_000
"""Steps kept in memory: a day at 1 Hz."""


class Step(msgspec.Struct, frozen=True):
    """One step.

    `kind` is "prepare" or "step"; `computing_time_s` is the brain's, `tick_time_s` includes prediction and
    publication [s].
    """

    kind: str
    mission_time_s: float
    computing_time_s: float
    tick_time_s: float
    plan_source: str
    reason: str
    deadline_missed: bool


class StepLog:
    """Counts, and keeps the times; with a file, each step is handed to the system at once."""

    def __init__(self, path: Path | None = None) -> None:
        self.steps: deque[Step] = deque(maxlen=KEPT)
        self.skipped = 0
        self.misses = 0
        self.count = 0
        try:
            self._file = path.open("ab", buffering=0) if path else None
        except OSError as error:
            raise UserError(f"step log {path}: cannot be written: {error.strerror}") from None

    def add(self, step: Step) -> None:
        """Note a step."""
        self.steps.append(step)
        self.count += step.kind == "step"
        self.misses += step.deadline_missed
        if self._file is None:
            return
        try:
            self._file.write(msgspec.json.encode(step) + b"\n")
        except OSError:  # a full disk must not stop the control
            self.close()

    @property
    def last(self) -> Step | None:
        """The newest step."""
        return self.steps[-1] if self.steps else None

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()
            self._file = None


def read_steps(path: Path) -> list[Step]:
    """Read a step log, without a torn last line; empty when there is none.

    Raises
    ------
    UnreadableFileError
        It is not such a log.
    """
    if not path.exists():
        return []
    try:
        return [msgspec.json.decode(line, type=Step) for line in path.read_bytes().split(b"\n")[:-1]]
    except (OSError, msgspec.MsgspecError) as error:
        raise UnreadableFileError(f"step log {path}: cannot be read: {error}") from None
