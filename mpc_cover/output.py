"""Where commands write, by one rule: nothing is overwritten unasked.

Without `--out` a command takes a name that is free; an `--out` that holds what it would write already is refused before
any work, unless `--overwrite` is given. Studies that resume add to their folder instead.
"""

from __future__ import annotations

import tempfile
from itertools import count
from typing import TYPE_CHECKING

from mpc_cover.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Taken = Callable[[Path], Path | None]
    """Returns what is at a path already and would be lost; None where nothing would be."""


def output_path(
    given: Path | None, default: Path, taken: Taken, *, overwrite: bool = False, option: str = "--out"
) -> Path:
    """Return where to write: as given, or the first of DEFAULT, DEFAULT-2, ... that does not exist.

    Parameters
    ----------
    given : the value of `option`, None where it is left out.
    taken : what of the given file or folder would be lost.
    overwrite : whether that is wanted.

    Raises
    ------
    UserError
        Something would be lost.
    """
    if given is None:
        return free_path(default)
    try:
        found = None if overwrite else taken(given)
    except (OSError, ValueError):  # a name with a NUL, a folder that nobody may read: told when it is written
        found = None
    if found is not None:
        raise UserError(f"{option} {given}: {found} is there already: give another {option}, or --overwrite")
    return given


def free_path(path: Path) -> Path:
    """Return a path as it is, or with the first number that makes it one that does not exist: a-2, or a-2.npz."""
    suffix = path.suffix if path.suffix == ".npz" else ""
    stem = path.name.removesuffix(suffix)
    names = (path.with_name(f"{stem}-{number}{suffix}") for number in count(2))
    return path if not path.exists() else next(each for each in names if not each.exists())


def file_taken(path: Path) -> Path | None:
    """Return a file that exists."""
    return path if path.is_file() else None


def any_of(*patterns: str) -> Taken:
    """Return a function that finds the first file of some names, or patterns, in a folder."""

    def taken(folder: Path) -> Path | None:
        return next((file for pattern in patterns for file in sorted(folder.glob(pattern))), None)

    return taken


def check_folder(folder: Path, option: str = "--out") -> None:
    """Make a folder, and check before the work that files can be written into it.

    Raises
    ------
    UserError
        It cannot.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except (OSError, ValueError) as error:  # a ValueError for a name with a NUL
        reason = getattr(error, "strerror", None) or error
        raise UserError(f"{option} {folder}: cannot be written: {reason}") from None
