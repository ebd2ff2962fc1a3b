"""Our planner from the given guess, with each back-end, and `mpc-cover plan` with starts of its own.

Both are `planning.planner.Planner` as `mpc-cover plan` uses it: nothing is tuned here. The iterates that its SQP
accepts are observed through `Task.on_iterate`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from mpc_cover.planning.offline import SEARCH
from mpc_cover.planning.planner import Planner
from mpc_cover.studies.watch import Enough

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mpc_cover.arrays import FloatArray
    from mpc_cover.studies.case import Case
    from mpc_cover.studies.watch import Answer, Watch

_ANYTIME = replace(SEARCH, rounds=None)
"""What `mpc-cover plan --time-limit` searches."""


def from_guess(case: Case, x: FloatArray, watch: Watch, *, backend: str) -> Answer:
    """Plan as `mpc-cover plan` does, from the guess `x` and no other."""
    return _planned(case, x, watch, backend, {"given": x})


def from_own_starts(case: Case, x: FloatArray, watch: Watch) -> Answer:
    """Plan as `mpc-cover plan` does; the given guess `x` is not used."""
    return _planned(case, x, watch, "native", None)


def _planned(case: Case, x: FloatArray, watch: Watch, backend: str, given: Mapping[str, FloatArray] | None) -> Answer:
    planner, seen = Planner(backend), _Iterates(watch, x)
    watch.begin(None if given is None else x)
    task = replace(case.task, on_iterate=seen)
    try:
        best = planner.fixed(task, case.ocp.steps, _ANYTIME, watch.budget, given=given)
    except Enough:
        return watch.answer(seen.x, seen.count, "everything is covered" if watch.complete else "time is up")
    found = case.ocp.decision(best.plan.position[0], best.plan.velocity)
    stages = best.refined.stages if best.refined is not None else ()
    ended = f": {stages[-1].outcome.sentence}" if stages else ""
    return watch.answer(found, seen.count, f"best start: {best.origin.name}{ended}")


class _Iterates:
    """Passes each iterate to the watch; one that covers everything ends the search, as for all peers.

    Attributes
    ----------
    count : steps that the SQP took.
    x : the last iterate, at first what was given.
    """

    def __init__(self, watch: Watch, x: FloatArray) -> None:
        self.count, self.x = 0, x
        self._watch = watch

    def __call__(self, x: FloatArray) -> None:
        self.count, self.x = self.count + 1, x
        if self._watch.see(x):
            raise Enough
