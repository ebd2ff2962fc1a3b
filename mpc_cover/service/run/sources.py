"""The records that were written in flight, of which a recording was made: digests of them are among its facts."""

from __future__ import annotations

import hashlib
import math
from typing import TYPE_CHECKING

from mpc_cover.verification.report import Check, CheckName

if TYPE_CHECKING:
    from pathlib import Path

    from mpc_cover.trajectory_file import Recording

SOURCES = "records"
"""Where the digests are in a recording's `meta`: SHA-256 in hexadecimal, by the file's name."""


def source_digests(folder: Path) -> dict[str, str]:
    """Return the digests of all records of a run folder, by file name; an OSError where one cannot be read."""
    files = sorted((folder / "agents").glob("*.jsonl"))
    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in files}


def check_sources(trajectory: Recording, folder: Path) -> Check | None:
    """Check that the records in a run folder are those of which its recording was made.

    None where there are none, as of plans and simulations, or where the recording was taken elsewhere without them.
    """
    stated = trajectory.meta.get(SOURCES)
    if stated is None or not (folder / "agents").is_dir():
        return None
    try:
        found = source_digests(folder)
    except OSError as error:
        return Check(CheckName.SOURCES, False, -math.inf, "", f"{folder / 'agents'}: {error.strerror}")
    if not isinstance(stated, dict):
        return Check(CheckName.SOURCES, False, -math.inf, "", "the recording does not say which")
    other = sorted(name for name in found.keys() | stated.keys() if found.get(name) != stated.get(name))
    where = f"{', '.join(other)}: changed, removed or added since" if other else f"{len(found)} records"
    return Check(CheckName.SOURCES, not other, -math.inf if other else 0.0, "", where)
