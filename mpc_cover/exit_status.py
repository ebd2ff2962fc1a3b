"""The exit statuses of all commands, by one function."""

from __future__ import annotations

from enum import IntEnum


class ExitStatus(IntEnum):
    """What a command's exit status says."""

    WELL = 0
    """All is well; also of a daemon that was told to end."""
    UNFULFILLED = 1
    """Something does not hold, is not covered, was refused or not answered, or could not be printed."""
    MISTAKE = 2
    """A mistake in what was asked for."""
    INTERRUPTED = 130
    """Ctrl-C: 128 + SIGINT, as shells have it."""


def exit_status(*, holds: bool = True, covered: bool = True, interrupted: bool = False) -> int:
    """Return the exit status of a command.

    Parameters
    ----------
    holds : everything that was to hold does: checks of the verifier, flights that did not break off, what was asked.
    covered : nothing that is owed is left.
    interrupted : Ctrl-C ended it before it was done.
    """
    if interrupted:
        return int(ExitStatus.INTERRUPTED)
    return int(ExitStatus.WELL if holds and covered else ExitStatus.UNFULFILLED)
