"""What may be flown from a state: the ways as before, slow sweeps of many looks, and what a search finds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpc_cover.planning.budget import part_of
from mpc_cover.planning.initial_guess.plan_repair import repaired_plan
from mpc_cover.planning.task import Task, needs_laps

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from mpc_cover.control.demand_allocation import DemandAllocation
    from mpc_cover.control.planning_constraints import PlanningConstraints
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.planner import Planner
    from mpc_cover.planning.task import Candidate

_REST = 0.05
"""Part of the cells on which a plan that is to bring many looks in one go may leave some."""


class CandidateGenerator:
    """Finds plans for what is owed, and keeps those that the verifier passes.

    Attributes
    ----------
    former : the mission plan of before a fault, whose ways may still do.
    """

    def __init__(self, mission: Mission, constraints: PlanningConstraints, orders: DemandAllocation) -> None:
        self._cell, self._control = mission.field.cell, mission.spec.control
        self._constraints, self._allocation = constraints, orders
        self.former: Trajectory | None = None

    def best(
        self,
        start: FleetState,
        deadline: float | None,
        search: Callable[[Task, float | None], Candidate],
        planner: Planner,
    ) -> Candidate | None:
        """Return the better of what is left of the former plan and of a search, for which a step may be too short."""
        if (slow := self._in_one_go(start, deadline, planner)) is not None:
            return slow
        task, found = self._task(start), []
        if self.former is not None:
            found.append(repaired_plan(task, self.former))
        if deadline is None or not found or not found[0].covers:
            found.append(search(task, deadline))
        return self._best_sound(found, start)

    def _in_one_go(self, start: FleetState, deadline: float | None, planner: Planner) -> Candidate | None:
        """Return a plan that brings all of many looks without going round again, if there is one."""
        task = self._task(start, in_one_go=True)
        if not needs_laps(task.looks):
            return None
        found = [] if self.former is None else [repaired_plan(task, self.former)]
        if not any(one.complete for one in found):
            effort_s, thorough = self._control.planning_time_s, not start.velocity.any()
            found = planner.timed_sweeps(task, part_of(deadline, 0.5), effort_s, thorough=thorough)
        return self._best_sound((one for one in found if _brings_most(task, one)), start)

    def _best_sound(self, found: Iterable[Candidate], start: FleetState) -> Candidate | None:
        sound = (one for one in found if one.feasible and self._constraints.keeps(one.plan, start))
        return min(sound, key=lambda candidate: candidate.rank, default=None)

    def _task(self, start: FleetState, *, in_one_go: bool = False) -> Task:
        weight, looks = self._allocation.next(start, in_one_go=in_one_go)
        state = (start.position, start.velocity, start.time)
        fleet, owed = self._constraints.mission.fleet, weight * self._constraints.measurable
        return Task(fleet, self._cell, owed, *state, self._control.period_s, looks=looks)


def _brings_most(task: Task, candidate: Candidate) -> bool:
    """Return whether a plan leaves so little that one more after it brings the rest."""
    return candidate.complete or float((task.owed_after(candidate.plan) > 0.0).mean()) <= _REST
