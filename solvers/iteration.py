"""The iteration of `solvers.sqp.solve`, and its state."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solvers.nlp import Measure, StepObserver
from solvers.outcome import Iterate, Outcome, Result
from solvers.qp import InvalidQPError
from solvers.status import Status

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from solvers.backends.base import Backend
    from solvers.nlp import Convexifiable, ConvexModel
    from solvers.solution import QPSolution
    from solvers.sqp_options import Options

USABLE = frozenset({Status.SOLVED, Status.INACCURATE, Status.MAX_ITERATIONS})
"""Outcomes of a subproblem whose x is a candidate: the merit function, not the QP, decides about the step."""


@dataclass(frozen=True)
class _Point:
    x: NDArray[np.float64]
    measure: Measure


@dataclass(frozen=True)
class _Candidate:
    """The candidate point of a subproblem, and the decrease of the merit that its model predicts."""

    point: _Point
    predicted: float
    step: float
    weight: float
    multipliers: NDArray[np.float64]


class Iteration:
    """The state of one run of `solve`."""

    def __init__(
        self,
        problem: Convexifiable,
        x0: NDArray[np.float64],
        backend: Backend,
        options: Options,
        clock: Callable[[], float],
        deadline: float | None,
    ) -> None:
        self._problem, self._backend, self._options = problem, backend, options
        self._clock, self._deadline = clock, deadline
        self._begun = clock()
        self._point = self._best = self._measured(x0)
        self._region = options.region
        self._history: list[Iterate] = []
        self._last: QPSolution | None = None
        self._failures = 0
        self._detail = ""

    def run(self) -> Result:
        """Iterate until a termination criterion holds."""
        outcome = None if math.isfinite(self._point.measure.merit(1.0)) else Outcome.INVALID_START
        while outcome is None:
            if len(self._history) >= self._options.max_iterations:
                outcome = Outcome.MAX_ITERATIONS
            elif self._deadline is not None and self._clock() >= self._deadline:
                outcome = Outcome.DEADLINE
            else:
                outcome = self._iterate()
        best, last = self._best, self._last
        return Result(
            best.x,
            best.measure.objective,
            best.measure.violation,
            outcome,
            len(self._history),
            tuple(self._history),
            last.y if last else None,
            last.residuals if last else None,
            self._detail,
        )

    def _iterate(self) -> Outcome | None:
        """Solve one subproblem and accept or reject its step; return the outcome that ends the run, or None."""
        begun, radius = self._clock(), self._region.radius
        model = self._problem.convexify(self._point.x, radius)
        try:
            solution = self._solve(model)
        except InvalidQPError as error:
            self._detail = str(error)
            return Outcome.SUBPROBLEM_FAILED
        self._last = solution
        qp_time_s = self._clock() - begun
        candidate = self._candidate(model, solution)
        if candidate is None:
            outcome, accepted, step, predicted = self._failed(solution), False, 0.0, 0.0
        else:
            self._failures, self._detail = 0, ""
            outcome, accepted = self._try(candidate)
            step, predicted = candidate.step, candidate.predicted
        measure = self._point.measure
        self._history.append(
            Iterate(
                measure.objective,
                measure.violation,
                radius,
                step,
                accepted,
                predicted,
                solution.status,
                solution.iterations,
                qp_time_s,
                self._clock() - self._begun,
            )
        )
        return outcome

    def _solve(self, model: ConvexModel) -> QPSolution:
        begun = self._clock()
        fresh = self._backend.load(model.qp, self._options.qp)
        if model.start is not None:
            self._backend.warm_start(model.start)
        if self._deadline is None:
            return self._backend.solve()
        # after a set-up the back-end measures its time limit from the beginning of the set-up
        return self._backend.solve(self._deadline - (begun if fresh else self._clock()))

    def _candidate(self, model: ConvexModel, solution: QPSolution) -> _Candidate | None:
        """Return the candidate of the subproblem, or None if it failed."""
        if solution.status not in USABLE:
            return None
        predicted = model.predicted(solution.x)
        # an unsolved subproblem that predicts no decrease does not prove stationarity
        if not math.isfinite(predicted) or (self._negligible(predicted) and not solution.ok):
            return None
        point = self._measured(model.recover(solution.x))
        step = model.length(point.x) if model.length else float(np.abs(point.x - self._point.x).max())
        return _Candidate(point, predicted, step, model.weight, solution.y)

    def _failed(self, solution: QPSolution) -> Outcome | None:
        """End the run, or enlarge or shrink the trust region, whichever may help."""
        self._detail = f"{solution.status.sentence} ({solution.detail})"
        if solution.status is Status.TIME_LIMIT:
            return Outcome.DEADLINE
        if solution.status is Status.INTERRUPTED:
            return Outcome.INTERRUPTED
        self._failures += 1
        if self._failures >= self._options.failures:
            return Outcome.SUBPROBLEM_FAILED
        region = self._region
        factor = region.grow if solution.status is Status.PRIMAL_INFEASIBLE else region.shrink
        self._region = region.resized(factor * region.radius)
        return None

    def _try(self, candidate: _Candidate) -> tuple[Outcome | None, bool]:
        """Accept the candidate, a shorter step or none; return an outcome if it ends the run, and whether it moved."""
        if self._negligible(candidate.predicted):
            return self._stationary(candidate, Outcome.CONVERGED)
        if candidate.step <= self._options.smallest_step:
            return self._stationary(candidate, Outcome.SMALL_STEP)
        if self._moved(candidate):
            return None, True
        self._region = self._region.rejected(candidate.step)
        return (Outcome.STALLED if self._region.exhausted else None), False

    def _negligible(self, predicted: float) -> bool:
        """Return whether even a step of the initial radius would not decrease the merit noticeably.

        The decrease of a convex model is concave in the radius, so that of the first radius is at most
        that of the present one times their ratio.
        """
        share = min(1.0, self._region.radius / self._options.region.radius)
        return predicted <= self._options.optimality * max(1.0, abs(self._point.measure.objective)) * share

    def _stationary(self, candidate: _Candidate, outcome: Outcome) -> tuple[Outcome | None, bool]:
        """End at a stationary point of the merit function, which need not be feasible."""
        moved = self._decrease(candidate.point, candidate.weight) > 0.0
        if moved:
            self._take(candidate.point, candidate)
        feasible = self._point.measure.violation <= self._options.feasibility
        return (outcome if feasible else Outcome.INFEASIBLE), moved

    def _moved(self, candidate: _Candidate) -> bool:
        """Take the full step or the first shorter one with a sufficient decrease; return whether there was one."""
        predicted, weight = candidate.predicted, candidate.weight
        sufficient = self._options.sufficient * predicted
        full, x = candidate.point, self._point.x
        if (decrease := self._decrease(full, weight)) >= sufficient:
            self._region = self._region.accepted(decrease / predicted, candidate.step)
            self._take(full, candidate)
            return True
        found = self._options.line_search.search(
            lambda length: self._measured(x + length * (full.x - x)),
            lambda point: self._decrease(point, weight),
            predicted,
        )
        if found is None:
            return False
        length, point = found
        # never larger: the step length may include components that the radius does not bound
        self._region = self._region.resized(min(self._region.radius, length * candidate.step))
        self._take(point, candidate)
        return True

    def _take(self, point: _Point, candidate: _Candidate) -> None:
        """Make this the current point, and the best one if it is better."""
        if isinstance(self._problem, StepObserver):
            self._problem.accepted(self._point.x, point.x, candidate.multipliers)
        self._point = point
        new, old = point.measure, self._best.measure
        limit = self._options.feasibility
        if max(new.violation, old.violation) <= limit:
            better = new.objective < old.objective
        else:
            better = new.violation < old.violation
        if better:
            self._best = point

    def _decrease(self, point: _Point, weight: float) -> float:
        return self._point.measure.merit(weight) - point.measure.merit(weight)

    def _measured(self, x: NDArray[np.float64]) -> _Point:
        return _Point(x, self._problem.measure(x))
