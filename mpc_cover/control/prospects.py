"""What may be flown from a state: the ways as before, slow sweeps of many looks, and what a search finds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpc_cover.control.salvage import as_before
from mpc_cover.planning.deadline import part_of
from mpc_cover.planning.task import Task, takes_laps

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from mpc_cover.control.footing import Footing
    from mpc_cover.control.orders import Orders
    from mpc_cover.control.stretch import Start
    from mpc_cover.mission.load import Mission
    from mpc_cover.planning.engine import Engine
    from mpc_cover.planning.plan import Plan
    from mpc_cover.planning.task import Candidate

_REST = 0.05
"""Part of the cells on which a plan that is to bring many looks in one go may leave some."""


class Prospects:
    """Finds plans for what is owed, and keeps those that the verifier passes.

    Attributes
    ----------
    former : the mission plan of before a fault, whose ways may still do.
    """

    def __init__(self, mission: Mission, footing: Footing, orders: Orders) -> None:
        self._cell, self._control = mission.field.cell, mission.spec.control
        self._footing, self._orders = footing, orders
        self.former: Plan | None = None

    def best(
        self, start: Start, deadline: float | None, search: Callable[[Task, float | None], Candidate], engine: Engine
    ) -> Candidate | None:
        """Return the better of what is left of the former plan and of a search, for which a step may be too short."""
        if (slow := self._in_one_go(start, deadline, engine)) is not None:
            return slow
        task, found = self._task(start), []
        if self.former is not None:
            found.append(as_before(task, self.former))
        if deadline is None or not found or not found[0].covers:
            found.append(search(task, deadline))
        return self._best_sound(found, start)

    def _in_one_go(self, start: Start, deadline: float | None, engine: Engine) -> Candidate | None:
        """Return a plan that brings all of many looks without going round again, if there is one."""
        task = self._task(start, in_one_go=True)
        if not takes_laps(task.looks):
            return None
        found = [] if self.former is None else [as_before(task, self.former)]
        if not any(one.complete for one in found):
            effort_s, thorough = self._control.planning_time_s, not start.velocity.any()
            found = engine.unhurried(task, part_of(deadline, 0.5), effort_s, thorough=thorough)
        return self._best_sound((one for one in found if _brings_most(task, one)), start)

    def _best_sound(self, found: Iterable[Candidate], start: Start) -> Candidate | None:
        sound = (one for one in found if one.feasible and self._footing.keeps(one.plan, start))
        return min(sound, key=lambda candidate: candidate.rank, default=None)

    def _task(self, start: Start, *, in_one_go: bool = False) -> Task:
        weight, looks = self._orders.next(start, in_one_go=in_one_go)
        state = (start.position, start.velocity, start.time)
        fleet, owed = self._footing.mission.fleet, weight * self._footing.measurable
        return Task(fleet, self._cell, owed, *state, self._control.period_s, looks=looks)


def _brings_most(task: Task, candidate: Candidate) -> bool:
    """Return whether a plan leaves so little that one more after it brings the rest."""
    return candidate.complete or float((task.owed_after(candidate.plan) > 0.0).mean()) <= _REST
