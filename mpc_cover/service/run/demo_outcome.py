"""The outcome of a demo, and its result."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto
from typing import TYPE_CHECKING

from mpc_cover import exit_status as statuses

if TYPE_CHECKING:
    from mpc_cover.verification.summary import RunSummary


class Ending(Enum):
    """How a demo ended."""

    COMPLETE = auto()
    """The mission ended as it should, perhaps without agents that died."""
    FAILED = auto()
    INTERRUPTED = auto()


@dataclass(frozen=True)
class Outcome:
    """How a demo ended, and the same as a text for users."""

    ending: Ending
    text: str


INTERRUPTED_OUTCOME = Outcome(Ending.INTERRUPTED, "interrupted")


@dataclass(frozen=True, eq=False)
class DemoResult:
    """The result of a demo.

    Attributes
    ----------
    exit_status : of the command.
    outcome : how it ended, as a text.
    summary : of the run; None when nothing was flown.
    controller_restarts : how often the controller was started again.
    lost : ids of the agents that died.
    """

    exit_status: int
    outcome: str
    summary: RunSummary | None
    controller_restarts: int
    lost: tuple[str, ...] = ()


def exit_status(outcome: Outcome, summary: RunSummary | None, signal_received: int) -> int:
    """Return the exit status of a demo: 0 if it is complete and its recording holds, 130 after Ctrl-C, else 1."""
    return statuses.exit_status(
        holds=outcome.ending is Ending.COMPLETE and summary is not None and summary.holds,
        covered=summary is not None and summary.covered_cells == summary.cells,
        interrupted=bool(signal_received),
    )
