"""What all ways to make initial guesses have in common."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.initial_guess.guess import Guess
    from mpc_cover.planning.task import Task


class InitialGuess(Protocol):
    """A way to make guesses."""

    def guesses(self, task: Task, incumbent: Trajectory | None = None) -> Iterator[Guess]:
        """Yield guesses for a task, the most promising first; `incumbent` is the plan that there is, if any.

        Nothing is promised about them: they are flown within the limits, refined and judged by whoever asks.
        """
        ...
