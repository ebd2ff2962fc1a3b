"""Fall-back from one back-end to the next: what one does not bear, or breaks down on, another one solves.

Each QP is given to the back-ends in their order, to each at most once: those that do not bear its size or lack cones
are passed over, and one that breaks down is followed by the next. The next QP begins with the first again, so that the
answers depend on the QPs alone.
"""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from solvers.backends.options import Options
from solvers.backends.registry import make_backend
from solvers.checks import InvalidQPError
from solvers.status import Status

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from solvers.backends.base import Backend
    from solvers.backends.capabilities import Capabilities
    from solvers.qp import QP
    from solvers.solution import QPSolution

ORDER = ("piqp", "clarabel", "osqp")
"""The back-ends to fall to, fastest at the accuracy of plans first (see their capabilities); a plain choice."""
BROKEN_DOWN = frozenset({Status.NUMERICAL_ERROR, Status.INVALID_DATA, Status.UNKNOWN})
"""Outcomes that say nothing about the QP, so that another back-end may solve it."""
UNSOLVED = "none"
"""Under this name `answered` counts QPs on which every back-end broke down."""


class FallbackBackend:
    """Back-ends in an order, behind the interface of `Backend`; name and capabilities are those of the first.

    Parameters
    ----------
    makers : return the back-ends, in order; each is called once, when its back-end is needed.
    clock : monotonic time [s].

    Attributes
    ----------
    answered : number of QPs by the name of the back-end whose answer was returned.
    """

    def __init__(self, makers: Sequence[Callable[[], Backend]], clock: Callable[[], float] = time.perf_counter) -> None:
        self.answered: Counter[str] = Counter()
        self._makers, self._clock = tuple(makers), clock
        self._members = [makers[0]()]
        self._current = 0  # the first member that bears the QP
        self._options: Options | None = None
        self._start: tuple[NDArray[np.float64], NDArray[np.float64] | None] | None = None
        self._begun: float | None = None  # of a set-up since the last solve

    @property
    def name(self) -> str:
        """The name of the first back-end."""
        return self._members[0].name

    @property
    def capabilities(self) -> Capabilities:
        """What the first back-end can do."""
        return self._members[0].capabilities

    @property
    def qp(self) -> QP:
        """The current data."""
        return self._members[self._current].qp

    def setup(self, qp: QP, options: Options | None = None) -> None:
        """Take a new problem, see `Backend.setup`.

        Raises
        ------
        InvalidQPError: for invalid data, or a QP that no back-end bears; nothing has changed then.
        """
        begun, number = self._clock(), self._first_bearing(qp)
        self._member(number).setup(qp, self._attainable(options, number))
        self._current, self._options, self._start, self._begun = number, options, None, begun

    def load(self, qp: QP, options: Options | None = None) -> bool:
        """Take a problem, by an update in place where possible, see `Backend.load`.

        Raises
        ------
        InvalidQPError: as of `setup`.
        """
        begun, number = self._clock(), self._first_bearing(qp)
        fresh = self._member(number).load(qp, self._attainable(options, number))
        self._current, self._options, self._start = number, options, None
        self._begun = begun if fresh else self._begun
        return fresh

    def update(self, **values: NDArray[np.float64] | None) -> None:
        """Replace values in place, see `Backend.update`."""
        self._members[self._current].update(**values)

    def warm_start(self, x: NDArray[np.float64], y: NDArray[np.float64] | None = None) -> None:
        """Start the next solve from x: (n,) and y: (m,), see `Backend.warm_start`."""
        self._members[self._current].warm_start(x, y)
        self._start = x.copy(), None if y is None else y.copy()

    def solve(self, time_limit_s: float | None = None) -> QPSolution:
        """Solve the current problem by the first back-end that does not break down on it, within one time limit [s].

        The `detail` of the solution names those that broke down, and why.
        """
        begun = self._clock() if self._begun is None else self._begun
        solution = self._members[self._current].solve(time_limit_s)
        number = self._bearing(self.qp, self._current + 1) if solution.status in BROKEN_DOWN else None
        while number is not None and solution.status in BROKEN_DOWN:
            left_s = None if time_limit_s is None else time_limit_s - (self._clock() - begun)
            if left_s is not None and left_s <= 0.0:
                break
            solution = _after(solution, self._solved_by(number, left_s))
            number = self._bearing(self.qp, number + 1)
        self.answered[UNSOLVED if solution.status in BROKEN_DOWN else solution.backend] += 1
        self._start = self._begun = None
        return solution

    def _solved_by(self, number: int, left_s: float | None) -> QPSolution:
        """Return a later member's solution of the current problem."""
        member = self._member(number)
        member.load(self.qp, self._attainable(self._options, number))
        if self._start is not None:
            member.warm_start(*self._start)
        return member.solve(left_s)

    def _member(self, number: int) -> Backend:
        while len(self._members) <= number:
            self._members.append(self._makers[len(self._members)]())
        return self._members[number]

    def _bearing(self, qp: QP, first: int) -> int | None:
        """Return the number of the next member, from `first` on, that bears a QP; None if there is none."""
        numbers = range(first, len(self._makers))
        return next((number for number in numbers if self._member(number).capabilities.bears(qp)), None)

    def _first_bearing(self, qp: QP) -> int:
        if (number := self._bearing(qp, 0)) is not None:
            return number
        limits = ", ".join(f"{one.name} {one.capabilities.variables_max}" for one in self._members)
        cones = "" if qp.cones is None else ", and some have no cones"
        raise InvalidQPError(f"q: {qp.n} variables are more than any back-end is given: {limits} at most{cones}")

    def _attainable(self, options: Options | None, number: int) -> Options | None:
        """Return options with a tolerance that a member attains: callers choose it by the first one's capabilities."""
        if number == 0:
            return options
        given = options or Options()
        return replace(given, tolerance=max(given.tolerance, self._member(number).capabilities.accurate))


def with_fallbacks(name: str, clock: Callable[[], float] = time.perf_counter) -> FallbackBackend:
    """Return the back-end of a name, followed by the others in their order; these are imported when they are needed.

    Raises
    ------
    UnknownBackendError: for a name that is not in `BACKENDS`.
    """
    names = (name, *(other for other in ORDER if other != name))
    return FallbackBackend([partial(make_backend, each, clock) for each in names], clock)


def _after(failed: QPSolution, solution: QPSolution) -> QPSolution:
    """Return a solution with the times and the work of the attempt that failed before it."""
    return replace(
        solution,
        setup_time_s=failed.setup_time_s + solution.setup_time_s,
        solve_time_s=failed.solve_time_s + solution.solve_time_s,
        work_per_entry_s=failed.work_per_entry_s + solution.work_per_entry_s,
        detail=f"{solution.detail} ({failed.backend}: {failed.detail})",
    )
