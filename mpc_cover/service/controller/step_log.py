"""The log of control steps: their durations and the sources of their plans; in a file one JSON value per line."""

from __future__ import annotations

from collections import deque
from enum import StrEnum
from typing import TYPE_CHECKING

import msgspec

from mpc_cover.errors import UnreadableFileError, UserError

if TYPE_CHECKING:
    from pathlib import Path


KEPT = 100_000
"""Steps kept in memory: a day at 1 Hz."""


class StepKind(StrEnum):
    """The kinds of control steps."""

    PREPARE = "prepare"
    """Planning while the fleet is at rest."""
    STEP = "step"
    """A step in flight."""


class Step(msgspec.Struct, frozen=True):
    """One step.

    `computing_time_s` is the control law's, `tick_time_s` includes prediction and publication [s]; `plan_source` is
    the name of a `PlanSource`.
    """

    kind: StepKind
    mission_time_s: float
    computing_time_s: float
    tick_time_s: float
    plan_source: str
    reason: str
    deadline_missed: bool


class StepLog:
    """Counts steps, and keeps them in memory; with a file, each is also written unbuffered.

    Attributes
    ----------
    steps : the newest steps, in order.
    skipped, misses, count : ticks without a step, missed deadlines, and steps in flight.
    """

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
        """Record a step."""
        self.steps.append(step)
        self.count += step.kind == StepKind.STEP
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
    """Read a step log, without an incomplete last line; empty when there is none.

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
