"""Candidates for the next mission plan: the former plan repaired, timed sweeps for many looks, and a search."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpc_cover.planning.candidate import evaluate_guess
from mpc_cover.planning.initial_guess.plan_repair import PlanRepair
from mpc_cover.planning.task import Task, needs_laps

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mpc_cover.control.demand_allocation import DemandAllocation
    from mpc_cover.control.planning_constraints import PlanningConstraints
    from mpc_cover.information.demand import DemandMap
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.candidate import Candidate
    from mpc_cover.planning.planner import Planner

_REST_SHARE = 0.05
"""Part of the cells on which a single-pass plan for many looks may leave some: one short plan takes the rest. Plain
choice."""
_TIMED_SWEEPS_SHARE = 0.5
"""Part of the budget for timed sweeps, where many looks are demanded; a plain choice."""


class CandidateGenerator:
    """Finds plans for the outstanding demand, and keeps those that the verifier accepts.

    Parameters
    ----------
    mission : provides cells and period.
    constraints : of the plans.
    allocation : of demand to mission plans.
    planner : searches for plans.
    """

    def __init__(
        self, mission: Mission, constraints: PlanningConstraints, allocation: DemandAllocation, planner: Planner
    ) -> None:
        self._cell, self._period = mission.field.cell, mission.spec.control.period_s
        self._constraints, self._allocation, self._planner = constraints, allocation, planner

    def best(
        self, state: FleetState, coverage: DemandMap, former: Trajectory | None, budget: Budget
    ) -> Candidate | None:
        """Return the best of the former plan, repaired, and of a search, which is thorough at rest; None for none.

        In flight there is no search where the repaired plan covers everything: it is better than what one step has
        time to find.
        """
        if (candidate := self._single_pass(state, coverage, former, budget)) is not None:
            return candidate
        task, found = self._task(state, coverage), []
        if former is not None:
            found.append(_repaired(task, former))
        if state.settled or not found or not found[0].covers:
            search = self._planner.thorough if state.settled else self._planner.quick
            found.append(search(task, budget))
        return self._best_verified(found, state)

    def _single_pass(
        self, state: FleetState, coverage: DemandMap, former: Trajectory | None, budget: Budget
    ) -> Candidate | None:
        """Return a plan that takes many looks in a single pass, or None."""
        task = self._task(state, coverage, single_pass=True)
        if not needs_laps(task.looks):
            return None
        found = [] if former is None else [_repaired(task, former)]
        if not any(one.complete for one in found):
            found = self._planner.timed_sweeps(task, budget.part(_TIMED_SWEEPS_SHARE), thorough=state.settled)
        return self._best_verified((one for one in found if _takes_most(task, one)), state)

    def _best_verified(self, found: Iterable[Candidate], state: FleetState) -> Candidate | None:
        verified = (one for one in found if one.feasible and self._constraints.keeps(one.plan, state))
        return min(verified, key=lambda candidate: candidate.rank, default=None)

    def _task(self, state: FleetState, coverage: DemandMap, *, single_pass: bool = False) -> Task:
        weight, looks = self._allocation.next(coverage, state, single_pass=single_pass)
        here = (state.position, state.velocity, state.time)
        fleet, demand = self._constraints.planned, weight * self._constraints.reachable
        return Task(fleet, self._cell, demand, *here, self._period, looks=looks)


def _repaired(task: Task, former: Trajectory) -> Candidate:
    """Return the best candidate along the paths of a former plan."""
    return min((evaluate_guess(task, guess) for guess in PlanRepair().guesses(task, former)), key=lambda one: one.rank)


def _takes_most(task: Task, candidate: Candidate) -> bool:
    """Return whether a plan leaves so few cells that one short plan after it can complete them."""
    return candidate.complete or float((task.remaining_after(candidate.plan) > 0.0).mean()) <= _REST_SHARE
