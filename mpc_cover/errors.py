"""Errors of users: one clear message, exit status 2, never a traceback."""

from __future__ import annotations

import reprlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence


class UserError(Exception):
    """A mistake that the user can correct; the message says what is wrong, where, and what would be right."""


_SHORT = reprlib.Repr()
"""Shows one line of a value, even of one that nested YAML aliases expand to gigabytes."""
_SHORT.maxlevel = 4
_SHORT.maxstring = _SHORT.maxlong = _SHORT.maxother = 80


def _plain(value: object) -> object:
    """Return numbers and arrays of NumPy as Python's own."""
    if isinstance(value, tuple):
        return tuple(_plain(item) for item in value)
    return value.tolist() if hasattr(value, "tolist") else value


@dataclass(frozen=True)
class Problem:
    """One mistake in an input: where it is, what was found, what would be right."""

    path: str
    value: object
    right: str
    of: str = ""
    """Id of the agent that the path is one of."""

    def __str__(self) -> str:
        where = f"{self.path} ({self.of})" if self.of else self.path
        if self.value is None and self.right.startswith("is missing"):
            return f"{where}: {self.right}"
        shown = _SHORT.repr(_plain(self.value))
        if len(shown) > 80:  # noqa: PLR2004 - a line of a terminal
            shown = shown[:77] + "..."
        return f"{where}: {shown}: {self.right}"


class InvalidInputError(UserError):
    """An input with one or more mistakes, all of them listed at once."""

    def __init__(self, what: str, problems: Iterable[Problem]) -> None:
        self.problems: Sequence[Problem] = tuple(problems)
        count = len(self.problems)
        lines = "".join(f"\n  {problem}" for problem in self.problems)
        super().__init__(f"{what}: {count} problem{'s' if count != 1 else ''}{lines}")


def problems_of(error: UserError) -> list[dict[str, str]]:
    """Return the mistakes that an error lists, as plain data: each with its path, the value and what would be right."""
    found = error.problems if isinstance(error, InvalidInputError) else ()
    return [
        {"path": each.path, "value": _SHORT.repr(_plain(each.value)), "right": each.right, "agent": each.of}
        for each in found
    ]


class UnreadableFileError(UserError):
    """A file that is missing, truncated or malformed."""
