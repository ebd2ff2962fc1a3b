"""The disk of a simulated controller: real files, which cannot be written at times, and are torn by its death."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

from mpc_cover.service.torture.faults import Fault, FaultKind

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

_TEMPORARY = ("coverage.0.tmp", "coverage.1.tmp", "epoch.tmp")
"""Files that are written before they replace others: where a folder is in their place, writing fails with OSError."""


class Disk:
    """A folder that is full while a fault lasts.

    Parameters
    ----------
    path : the controller's state directory.
    """

    def __init__(self, path: Path, faults: Sequence[Fault], seed: str) -> None:
        self._path, self._seed = path, seed
        self._faults = [fault for fault in faults if fault.kind is FaultKind.DISK]

    def fill(self, *, full: bool) -> None:
        """Let writing fail from now on, or succeed again."""
        self._path.mkdir(parents=True, exist_ok=True)
        for name in _TEMPORARY:
            place = self._path / name
            if full:
                place.unlink(missing_ok=True)
                place.mkdir(exist_ok=True)
            elif place.is_dir():
                place.rmdir()

    def crash(self, time_s: float) -> None:
        """Tear the newest checkpoint where a fault says so: its last part never reached the disk."""
        if not any(fault.way == "torn" and fault.on(time_s) for fault in self._faults):
            return
        files = [file for file in self._path.glob("coverage.?") if file.is_file()]
        if files:
            newest = max(files, key=lambda file: (file.stat().st_mtime_ns, file.name))
            size = newest.stat().st_size
            chance = random.Random(f"{self._seed}/torn/{time_s}")  # noqa: S311 - reproducible, no secret
            newest.write_bytes(newest.read_bytes()[: chance.randrange(size)])
