"""Checkpoints of what was covered: torn or damaged ones are recognised, and the older one is taken."""

from __future__ import annotations

import hashlib
import time
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from mpc_cover.service.fingerprint import mission_hash
from mpc_cover.service.journal import Snapshot
from mpc_cover.service.state_directory import write_durably

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.state_directory import StateDirectory

GENERATIONS = 2
PERIOD_S = 1.0
"""How often a checkpoint is written [s of the machine's clock]."""


class _Header(msgspec.Struct, frozen=True):
    """What precedes the (J, K) times, which follow as little-endian doubles."""

    mission: str
    generation: int
    mission_time_s: float
    finished: bool
    shape: tuple[int, int]
    origins: dict[str, float]
    schema: int = 1
    lost: dict[str, list[float]] = {}


def pack(snapshot: Snapshot, mission: str, generation: int) -> bytes:
    """Return the bytes of a checkpoint: a checksum, a header, the times."""
    rows, columns = snapshot.first.shape
    header = _Header(
        mission,
        generation,
        snapshot.mission_time_s,
        snapshot.finished,
        (rows, columns),
        snapshot.origins,
        lost=snapshot.lost,
    )
    body = msgspec.json.encode(header) + b"\n" + snapshot.first.astype("<f8").tobytes()
    return hashlib.sha256(body).hexdigest().encode() + b"\n" + body


def unpack(data: bytes) -> tuple[str, int, Snapshot] | None:
    """Return mission hash, generation and snapshot, or None when the bytes are torn or damaged."""
    checksum, _, body = data.partition(b"\n")
    if hashlib.sha256(body).hexdigest().encode() != checksum:
        return None
    try:
        head, _, times = body.partition(b"\n")
        header = msgspec.json.decode(head, type=_Header)
        first = np.frombuffer(times, dtype="<f8").astype(float).reshape(header.shape)
    except (msgspec.MsgspecError, ValueError):
        return None  # written by something else
    snapshot = Snapshot(header.mission_time_s, first, header.finished, header.origins, header.lost)
    return header.mission, header.generation, snapshot


class FileJournal:
    """Keeps checkpoints in a state directory, in turn in two files."""

    def __init__(
        self, folder: StateDirectory, mission: Mission, monotonic: Callable[[], float] = time.monotonic
    ) -> None:
        self._folder = folder
        self._mission = mission_hash(mission)
        self._shape = (len(mission.fleet.magnitudes), mission.field.size)
        self._monotonic = monotonic
        self._due_s = -np.inf
        self._kept = self._read()
        self._generation = max((generation for _, generation, _ in self._kept), default=0)

    def load(self) -> tuple[Snapshot | None, str]:
        """Return where to resume, if anywhere, and what to tell the user about it."""
        if not self._kept:
            damaged = any(path.exists() for path in self._paths())
            return None, "no checkpoint is readable: starts afresh" if damaged else ""
        mission, _, snapshot = max(self._kept, key=lambda kept: kept[1])
        if mission != self._mission or snapshot.first.shape != self._shape:
            return None, "the checkpoint is of another version of this mission: starts afresh"
        if snapshot.finished:
            return None, "the mission was finished: starts afresh"
        return snapshot, f"goes on from the checkpoint at mission time {snapshot.mission_time_s:.1f} s"

    def save(self, snapshot: Snapshot, *, now: bool) -> str | None:
        """Write a checkpoint, at most one a second unless `now`; return what went wrong, if anything."""
        time_s = self._monotonic()
        if not now and time_s < self._due_s:
            return None
        self._due_s = time_s + PERIOD_S
        generation = self._generation + 1
        try:
            write_durably(self._paths()[generation % GENERATIONS], pack(snapshot, self._mission, generation))
        except OSError as error:
            return f"the checkpoint cannot be written: {error.strerror}; control goes on"
        self._generation = generation
        return None

    def close(self) -> None:
        """Unlock the folder."""
        self._folder.close()

    def _paths(self) -> list[Path]:
        return [self._folder.path / f"coverage.{index}" for index in range(GENERATIONS)]

    def _read(self) -> list[tuple[str, int, Snapshot]]:
        kept = []
        for path in self._paths():
            try:
                data = path.read_bytes()
            except OSError:
                continue
            if (unpacked := unpack(data)) is not None:
                kept.append(unpacked)
        return kept
