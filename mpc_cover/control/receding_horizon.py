"""The receding-horizon control law: it knows the rest of the mission and re-solves the segment ahead.

A plan for the whole mission is made before anyone moves. Each step re-solves the segment within the horizon from the
newest state, asking for the same coverage a sample sooner, and splices it into the mission plan. What is proposed is
that segment, ended at rest and verified. What becomes of it the law learns by `published` alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.control.candidate_generation import CandidateGenerator
from mpc_cover.control.control_law import PlanSource, Proposal
from mpc_cover.control.demand_allocation import DemandAllocation
from mpc_cover.control.fallback_policy import best_proposal, stop_proposal
from mpc_cover.control.plan_improvement import PlanImprovement
from mpc_cover.control.planning_constraints import PlanningConstraints
from mpc_cover.control.recovery import Mode, ReplanHistory, Situation, next_mode, stays_at
from mpc_cover.planning.initial_guess.rendezvous import Rendezvous, out_of_range
from mpc_cover.planning.planner import Planner
from mpc_cover.planning.task import Task

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.information.demand import FlownMap
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.candidate import Candidate

_LAST = 3
"""So few samples before its end a mission plan that leaves something owed gives way to the next."""


@dataclass(frozen=True, eq=False)
class _Flight:
    """What the law goes by from one step to the next.

    Attributes
    ----------
    plan : the mission plan that is flown; None when there is none.
    former : a mission plan of before a fault, whose ways may still do.
    mode : what is done with the fleet.
    history : of thorough plannings.
    """

    plan: Trajectory | None
    former: Trajectory | None
    mode: Mode
    history: ReplanHistory


class RecedingHorizon:
    """The control law of the daemon and of the simulation.

    Parameters
    ----------
    mission : what to cover, with whom.
    backend : QP back-end: piqp, clarabel or osqp.
    seed : of whatever is random; with budgets of counted work the law is deterministic.
    planner : searches for plans; one with that back-end where it is left out.
    """

    tolerates_losses = True

    def __init__(
        self, mission: Mission, *, backend: str = "piqp", seed: int = 0, planner: Planner | None = None
    ) -> None:
        self.seed = seed
        self._field, self._period = mission.field, mission.spec.control.period_s
        self._planning_s = mission.spec.control.planning_time_s
        self._constraints = PlanningConstraints(mission)
        planner = planner or Planner(backend)
        self._allocation = DemandAllocation(mission.field)
        self._candidates = CandidateGenerator(mission, self._constraints, self._allocation, planner)
        self._improvement = PlanImprovement(mission, self._constraints, self._allocation, planner)
        self._incumbent: Trajectory | None = None
        self._flight = _Flight(None, None, Mode.NOMINAL, ReplanHistory(self._planning_s))
        self._proposed: tuple[Trajectory, _Flight] | None = None

    @property
    def mode(self) -> Mode:
        """What is done with the fleet; `REPLAN_AT_REST` when steps are too short for what is to be planned."""
        return self._flight.mode

    def published(self, trajectory: Trajectory) -> None:
        """Learn that a proposal was sent: it is the incumbent, and what it was made for is flown."""
        self._incumbent = trajectory
        if self._proposed is not None and self._proposed[0] is trajectory:
            self._flight = self._proposed[1]

    def step(self, state: FleetState, coverage: FlownMap, budget: Budget) -> Proposal:
        """Return the plan from the predicted state on; never raises for numerical trouble.

        For a fleet that has settled the whole mission is planned thoroughly. Whenever the budget is too short for a
        plan worth flying, the fleet stays at rest, and the next planning takes twice as long.
        """
        if self._constraints.update(state, self._incumbent):  # no plan of before is for this fleet
            self._flight = replace(self._flight, plan=None, former=self._flight.plan or self._flight.former)
        if state.settled:
            budget = budget.extended((self._flight.history.patience - 1.0) * self._planning_s)
        proposal, flight = self._decide(state, coverage, budget)
        self._proposed = proposal.trajectory, flight
        self._flight = _if_not_sent(self._flight, flight)
        return proposal

    def _decide(self, state: FleetState, coverage: FlownMap, budget: Budget) -> tuple[Proposal, _Flight]:
        """Return what to propose, and what the law goes by once it is sent."""
        flight = self._flight
        rest = None if state.settled else self._rest_of(flight.plan, state)
        situation = Situation(
            settled=state.settled,
            work_left=bool((coverage.owed & self._constraints.reachable).any()),
            parted=self._constraints.parted(state),
            lost_touch=bool(state.lost.any()) and out_of_range(state.position, self._constraints.fleet),
            torn=self._constraints.torn,
            on_plan=rest is not None,
        )
        mode = next_mode(flight.mode, situation)
        if mode in {Mode.STOP, Mode.REPLAN_AT_REST}:
            reason = "all is covered" if mode is Mode.STOP else "stops to plan at rest"
            proposal = stop_proposal(self._constraints, state, self._incumbent, reason)
        else:
            broken_off = flight.plan is not None and rest is None and state.time < flight.plan.end_time
            if broken_off and flight.mode is not Mode.RENDEZVOUS and not state.settled:
                flight = replace(flight, former=flight.plan)
            flight = replace(flight, plan=rest)
            flight, situation, reason = self._plan(flight, mode, situation, state, coverage, budget)
            mode = next_mode(mode, situation)
            proposal = best_proposal(self._constraints, state, flight.plan, self._incumbent, reason)
        if proposal.source is PlanSource.BRAKE:
            mode = next_mode(mode, replace(situation, safe=False))
        history = flight.history.after(mode) if state.settled else flight.history
        return proposal, replace(flight, mode=mode, history=history)

    def _plan(
        self,
        flight: _Flight,
        mode: Mode,
        situation: Situation,
        state: FleetState,
        coverage: FlownMap,
        budget: Budget,
    ) -> tuple[_Flight, Situation, str]:
        """Improve the mission plan, or find another one; return what is found with it, and how, in words."""
        plan, meets = flight.plan, flight.mode is Mode.RENDEZVOUS
        if plan is not None and not meets and not self._runs_out(plan, state, coverage):
            plan, reason = self._improvement.improved(plan, state, coverage, self._incumbent, budget)
            return replace(flight, plan=plan), situation, reason
        reason = "nothing better was found"
        if mode is Mode.NOMINAL:
            flight, situation, reason = self._cover(flight, situation, state, coverage, budget)
            mode = next_mode(mode, situation)
        if mode is Mode.RENDEZVOUS:
            flight, situation, reason = self._meet(flight, situation, state)
            in_touch = not out_of_range(state.position, self._constraints.fleet)
            if not situation.can_meet and situation.parted and in_touch:
                flight, situation, reason = self._cover(flight, situation, state, coverage, budget)
        if not state.settled and self._is_stranded(flight, state, coverage, budget):
            stranded, history = flight.history.stranded(state.position, float(coverage.residual.sum()))
            flight = replace(flight, history=history)
            situation = replace(situation, worth_replanning=situation.worth_replanning or stranded)
        return flight, situation, reason

    def _cover(
        self, flight: _Flight, situation: Situation, state: FleetState, coverage: FlownMap, budget: Budget
    ) -> tuple[_Flight, Situation, str]:
        """Take the best plan that is found for what is owed, if any is better than to go on as before."""
        best = self._candidates.best(state, coverage, flight.former, budget)
        if best is None:
            return flight, replace(situation, out_of_plans=flight.plan is None), "nothing better was found"
        if best.idle and flight.plan is not None and flight.mode is not Mode.RENDEZVOUS:
            return flight, situation, "no way on was found yet"
        hasty = best.idle and flight.former is not None
        worth = hasty or self._is_poor(best, flight, state, coverage)
        situation = replace(situation, worth_replanning=worth, on_plan=True)
        return replace(flight, plan=best.plan, former=None), situation, best.origin.name

    def _meet(self, flight: _Flight, situation: Situation, state: FleetState) -> tuple[_Flight, Situation, str]:
        """Fly on to where groups that are out of range of each other meet, or find such a plan."""
        if flight.plan is not None:
            return flight, situation, "meets again"
        nothing = np.zeros((self._constraints.reachable.shape[0], 0))
        here = (state.position, state.velocity, state.time)
        task = Task(self._constraints.fleet, self._field.cell[:0], nothing, *here, self._period)
        plans = (guess.motion for guess in Rendezvous().guesses(task))
        plan = next((plan for plan in plans if plan is not None and self._constraints.keeps(plan, state)), None)
        reason = "meets again" if plan is not None else "nothing better was found"
        return replace(flight, plan=plan), replace(situation, can_meet=plan is not None), reason

    def _is_poor(self, best: Candidate, flight: _Flight, state: FleetState, coverage: FlownMap) -> bool:
        """Return whether a plan leaves most of what is owed, so that longer planning is worth while."""
        if best.covers or coverage.endless:
            return False
        owed = self._left_by(state.position[None], state, coverage)
        return flight.history.is_poor(self._left_by(best.plan.position, state, coverage), owed)

    def _is_stranded(self, flight: _Flight, state: FleetState, coverage: FlownMap, budget: Budget) -> bool:
        """Return whether a fleet at rest finds no way on in time, though something is owed."""
        here, plan = state.position, flight.plan
        in_time = budget.left_s > -self._period
        seen = plan.position if plan is not None and in_time else here[None]
        if state.velocity.any() or not stays_at(seen, here):
            return False
        return bool((self._left_by(seen, state, coverage) > 0.0).any())

    def _runs_out(self, plan: Trajectory, state: FleetState, coverage: FlownMap) -> bool:
        """Return whether a mission plan has done its part, or is about to end, while more is to be done."""
        if coverage.endless:
            return not coverage.demand(state.time, state.position).gamma.any()
        if plan.steps > _LAST:
            return False
        _, looks = self._allocation.left(coverage, state, plan.position, self._constraints.planned.radius)
        left = self._left_by(plan.position, state, coverage)
        return self._allocation.more or (looks is not None and bool((left > 0.0).any()))

    def _rest_of(self, plan: Trajectory | None, state: FleetState) -> Trajectory | None:
        """Return what is left of the mission plan from this state on, or None when it is over or of no use."""
        if plan is None:
            return None
        done = round((state.time - plan.start_time) / self._period)
        if not 0 <= done < plan.steps:
            return None
        rest = state.trajectory(plan.velocity[done + 1 :], self._period)
        return rest if self._constraints.keeps(rest, state) else None

    def _left_by(self, later: FloatArray, state: FleetState, coverage: FlownMap) -> FloatArray:
        """Return the weights (J, K) of what is asked for and not brought by later positions of the plan."""
        weight, _ = self._allocation.left(coverage, state, later, self._constraints.planned.radius)
        return weight * self._constraints.reachable


def _if_not_sent(flown: _Flight, found: _Flight) -> _Flight:
    """Return what the law goes by should a proposal not be sent: as before, but what was found is not forgotten.

    Its ways may still do from where the fleet is then, and that steps are too short stays true.
    """
    former = found.plan if found.mode is Mode.NOMINAL else found.former
    mode = Mode.REPLAN_AT_REST if found.mode is Mode.REPLAN_AT_REST else flown.mode
    return replace(flown, former=former or flown.former, mode=mode)
