"""Our planner from the given guess, with each back-end, and `mpc-cover plan` with starts of its own.

The configuration is that of the planner itself: nothing is tuned here. Its iterates are seen from outside:
the problem that it solves is one that also reports what the SQP accepts.
"""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpc_cover.planning import scp as continuation
from mpc_cover.planning.basin_hopping import optimise_thoroughly
from mpc_cover.planning.coverage_nlp import CoverageNLP
from mpc_cover.planning.multistart import Search, multistart
from mpc_cover.studies.patching import patched
from mpc_cover.studies.watch import Enough
from solvers.backends.registry import make_backend

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray
    from mpc_cover.studies.case import Case
    from mpc_cover.studies.watch import Answer, Watch
    from solvers.nlp import ConvexModel

SEARCH = Search(starts=10, finalists=3, rounds=None)
"""What `mpc-cover plan` searches."""


@dataclass
class _Seen:
    """How many QPs were built, and the last point that the SQP accepted."""

    subproblems: int
    x: FloatArray


def refined(case: Case, x: FloatArray, watch: Watch, *, backend: str) -> Answer:
    """Refine the guess as `mpc-cover plan` refines its finalists: several ways, until everything is covered."""
    solver = make_backend(backend)
    watch.begin(x)
    with _watched(watch, x) as seen:
        try:
            found = optimise_thoroughly(case.ocp, x, solver, rounds=None, deadline=watch.deadline)
        except Enough:
            return watch.answer(seen.x, seen.subproblems, "everything is covered" if watch.complete else "time is up")
    status = found.stages[-1].outcome.sentence if found.stages else "nothing to do"
    return watch.answer(found.x, seen.subproblems, status)


def from_own_starts(case: Case, x: FloatArray, watch: Watch) -> Answer:
    """Plan as `mpc-cover plan` does; the given guess `x` is not looked at."""
    solver = make_backend("piqp")
    watch.begin()
    with _watched(watch, x) as seen:
        try:
            best = multistart(case.task, solver, case.ocp.steps, SEARCH, watch.deadline)[0]
        except Enough:
            return watch.answer(seen.x, seen.subproblems, "everything is covered" if watch.complete else "time is up")
    found = case.ocp.decision(best.plan.position[0], best.plan.velocity)
    return watch.answer(found, seen.subproblems, f"best start: {best.kind}")


@contextmanager
def _watched(watch: Watch, x: FloatArray) -> Iterator[_Seen]:
    """Show the watch what the planner's SQP accepts; a point that covers everything ends it as it ends any peer."""
    seen = _Seen(0, x)

    class Watched(CoverageNLP):
        """The planner's problem, which hears of accepted steps (`solvers.nlp.LearnsFromSteps`)."""

        def convexify(self, x: FloatArray, radius: float) -> ConvexModel:
            seen.subproblems += 1
            return super().convexify(x, radius)

        def accepted(self, x_old: FloatArray, x_new: FloatArray, multipliers: FloatArray) -> None:  # noqa: ARG002
            seen.x = x_new
            if watch.see(x_new):
                raise Enough

    with patched(continuation, "CoverageNLP", Watched):
        yield seen
