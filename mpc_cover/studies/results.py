"""The folder of a study: one file per run, from which tables and report are generated."""

from __future__ import annotations

import contextlib
import json
from typing import TYPE_CHECKING, Any

import msgspec

from mpc_cover.errors import UserError
from mpc_cover.studies.record import Record, columns, row_of
from mpc_cover.version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    import pyarrow as pa

MARKER = "study.json"
"""A folder with this file is a study's folder."""
FORMAT = 1
"""Of the marker and the records."""


class StudyFolder:
    """The results of a study; may hold runs of an earlier study of the same missions by the same version.

    Parameters
    ----------
    path : the folder; nothing is written before `open`.
    missions : a fingerprint of each mission by name.
    command : the command being run; `commands` are all that produced the results, each once.

    Raises
    ------
    UserError
        It holds other files, or results that cannot be compared with these.
    """

    def __init__(self, path: Path, missions: Mapping[str, str], command: str) -> None:
        self.path = path
        self.damaged = 0
        self._runs = path / "runs"
        self._records: dict[str, Record] = {}
        before = self._read_marker()
        self.commands = list(dict.fromkeys([*before.get("commands", []), command]))
        self._marker = {
            "format": FORMAT,
            "version": __version__,
            "missions": {**before.get("missions", {}), **missions},
            "commands": self.commands,
        }
        self._refuse_others(before, missions)
        self._read_records()

    @property
    def records(self) -> list[Record]:
        """All runs, in the order of their parameters."""
        return sorted(self._records.values(), key=_order)

    @property
    def finished(self) -> set[str]:
        """The keys of the runs that need not be flown again, without those that broke off."""
        return {key for key, record in self._records.items() if not record.error}

    def open(self) -> None:
        """Make the folder.

        Raises
        ------
        UserError
            It cannot be written.
        """
        try:
            self._runs.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(f"--out {self.path}: cannot be written: {error.strerror or error}") from None
        self.write(self.path / MARKER, (json.dumps(self._marker, indent=2) + "\n").encode())

    def keep(self, record: Record) -> None:
        """Write a finished run, atomically."""
        self._records[record.key] = record
        self.write(self._runs / f"{record.key}.json", msgspec.json.encode(record))

    def write_tables(self) -> list[Path]:
        """Write runs.parquet and runs.csv, one row per run; return the files."""
        import pyarrow as pa  # noqa: PLC0415 - half a second
        from pyarrow import csv, parquet  # noqa: PLC0415 - likewise

        table = table_of(self.records)
        files = [self.path / "runs.parquet", self.path / "runs.csv"]
        for file, write in zip(files, (parquet.write_table, csv.write_csv), strict=True):
            sink = pa.BufferOutputStream()
            write(table, sink)
            self.write(file, sink.getvalue().to_pybytes())
        return files

    def write(self, file: Path, content: bytes) -> Path:
        """Write a file atomically; return it.

        Raises
        ------
        UserError
            It cannot be written.
        """
        part = file.with_name(f"{file.name}.part")
        try:
            part.write_bytes(content)
            part.replace(file)
        except OSError as error:
            with contextlib.suppress(OSError):
                part.unlink()
            raise UserError(f"study {self.path}: {file.name} cannot be written: {error.strerror or error}") from None
        return file

    def _read_marker(self) -> dict[str, Any]:
        """Return the content of the marker; empty for a new folder."""
        try:
            if not self.path.exists() or (self.path.is_dir() and not any(self.path.iterdir())):
                return {}
            text = (self.path / MARKER).read_bytes()
        except FileNotFoundError:
            raise UserError(f"--out {self.path}: is not empty and not a study of mpc-cover: give another") from None
        except (OSError, ValueError) as error:  # a ValueError for a name with a NUL
            reason = getattr(error, "strerror", None) or error
            raise UserError(f"--out {self.path}: cannot be read: {reason}") from None
        try:
            marker = json.loads(text)
        except ValueError:
            marker = None
        if not isinstance(marker, dict) or marker.get("format") != FORMAT:
            raise UserError(f"--out {self.path}: {MARKER} is not of this version of mpc-cover: give another --out")
        return marker

    def _refuse_others(self, before: Mapping[str, Any], missions: Mapping[str, str]) -> None:
        if before and before.get("version") != __version__:
            made = f"by mpc-cover {before.get('version')}, this is {__version__}"
            raise UserError(f"--out {self.path}: holds results made {made}: give another --out")
        for name, fingerprint in missions.items():
            if before.get("missions", {}).get(name, fingerprint) != fingerprint:
                raise UserError(
                    f"--out {self.path}: holds results of another mission called {name}: give another --out"
                )

    def _read_records(self) -> None:
        for file in sorted(self._runs.glob("*.json")):
            try:
                record = msgspec.json.decode(file.read_bytes(), type=Record)
            except (OSError, msgspec.MsgspecError):
                self.damaged += 1
                continue
            self._records[record.key] = record


def table_of(records: Iterable[Record]) -> pa.Table:
    """Return the records as an Arrow table, one row per run."""
    import pyarrow as pa  # noqa: PLC0415 - half a second

    types = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
    schema = pa.schema([(name, types[_plain(kind)]) for name, kind in columns()])
    return pa.Table.from_pylist([row_of(record) for record in records], schema=schema)


def _plain(kind: Any) -> type:
    """Return the type of a column whose values may be None."""
    given = [member for member in getattr(kind, "__args__", (kind,)) if member is not type(None)]
    plain: type = given[0]
    return plain


def _order(record: Record) -> tuple[Any, ...]:
    steps, backend = record.horizon_steps or 0, record.backend or ""
    return record.mission, record.controller, record.period_s, steps, backend, record.starts, record.seed
