"""The folder of a torture: a marker, and one file for each flight, from which it goes on."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import msgspec

from mpc_cover.errors import UserError
from mpc_cover.studies.torture_runs import TortureRecord
from mpc_cover.version import __version__

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

MARKER = "torture.json"
"""A folder with this file is one of a torture."""


class TortureFolder:
    """The records of the flights of one mission under faults of the same kinds.

    Parameters
    ----------
    path : the folder; nothing is written before `open`.
    what : what all its flights have in common: the mission's fingerprint, kinds of faults, back-end.
    overwrite : whether flights that it holds are flown anew.

    Raises
    ------
    UserError
        It holds something else.
    """

    def __init__(self, path: Path, what: dict[str, object], *, overwrite: bool) -> None:
        self.path, self._runs = path, path / "seeds"
        self._marker = {"version": __version__, **what}
        self._overwrite = overwrite
        before = self._read_marker()
        if before is not None and before != self._marker and not overwrite:
            differing = ", ".join(key for key in self._marker if before.get(key) != self._marker[key])
            raise UserError(f"--out {path}: holds flights of another torture ({differing}): give another --out")
        known = before is not None and not overwrite
        self._records = {record.seed: record for record in self._read()} if known else {}

    def open(self) -> None:
        """Make the folder.

        Raises
        ------
        UserError
            It cannot be written.
        """
        try:
            self._runs.mkdir(parents=True, exist_ok=True)
            for old in self._runs.glob("*.json") if self._overwrite else ():
                old.unlink()
            (self.path / MARKER).write_text(json.dumps(self._marker, indent=2) + "\n", encoding="utf-8")
        except OSError as error:
            raise UserError(f"--out {self.path}: cannot be written: {error.strerror or error}") from None

    def known(self, seed: int) -> TortureRecord | None:
        """Return the record of a seed; None where it has not been flown."""
        return self._records.get(seed)

    def keep(self, record: TortureRecord) -> None:
        """Write a record, atomically.

        Raises
        ------
        UserError
            It cannot be written.
        """
        self._records[record.seed] = record
        file = self._runs / f"{record.seed}.json"
        part = file.with_suffix(".part")
        try:
            part.write_bytes(msgspec.json.encode(record))
            part.replace(file)
        except OSError as error:
            raise UserError(f"--out {self.path}: cannot be written: {error.strerror or error}") from None

    def records(self, seeds: Sequence[int]) -> list[TortureRecord]:
        """Return the records of some seeds, as far as they were flown."""
        return [self._records[seed] for seed in seeds if seed in self._records]

    def _read_marker(self) -> dict[str, object] | None:
        try:
            if not self.path.exists() or (self.path.is_dir() and not any(self.path.iterdir())):
                return None
            marker = json.loads((self.path / MARKER).read_bytes())
        except (OSError, ValueError):
            marker = None
        if not isinstance(marker, dict):
            raise UserError(f"--out {self.path}: is not empty and not a torture of mpc-cover: give another --out")
        return marker

    def _read(self) -> list[TortureRecord]:
        found = []
        for file in sorted(self._runs.glob("*.json")):
            try:
                found.append(msgspec.json.decode(file.read_bytes(), type=TortureRecord))
            except (OSError, msgspec.MsgspecError):
                continue  # torn: flown again
        return found
