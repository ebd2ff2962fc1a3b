"""The interface of initial-guess generators."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.initial_guess.guess import Guess
    from mpc_cover.planning.task import Task


class InitialGuess(Protocol):
    """A generator of initial guesses."""

    def guesses(self, task: Task, incumbent: Trajectory | None = None) -> Iterator[Guess]:
        """Yield guesses for a task, the most promising first; `incumbent` is the present plan, if any.

        Guesses need not be feasible: the caller tracks them within the limits, refines and evaluates them.
        """
        ...
