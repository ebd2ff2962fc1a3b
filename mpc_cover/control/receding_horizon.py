"""The receding-horizon control law: a plan for the whole mission, whose segment within the horizon is re-optimised.

The mission plan is computed before the fleet moves. Each step re-optimises the segment within the horizon from the
newest state, for the same coverage a sample sooner, and splices it into the mission plan. The proposal is that segment,
extended to rest and verified. The law learns by `published` alone which proposals were sent.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.control.candidate_generation import CandidateGenerator
from mpc_cover.control.control_law import PlanSource, Proposal
from mpc_cover.control.demand_allocation import DemandAllocation
from mpc_cover.control.fallback_policy import best_proposal, stop_proposal
from mpc_cover.control.idle_improvement import IdleImprovement
from mpc_cover.control.plan_improvement import PlanImprovement
from mpc_cover.control.planning_constraints import PlanningConstraints
from mpc_cover.control.recovery import Mode, ReplanHistory, Situation, next_mode, stays_at
from mpc_cover.control.work_estimate import work_bound
from mpc_cover.model.look_instants import inter_sample
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.initial_guess.rendezvous import Rendezvous, out_of_range
from mpc_cover.planning.planner import Planner
from mpc_cover.planning.task import Task

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mpc_cover.arrays import FloatArray
    from mpc_cover.information.demand import DemandMap
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.candidate import Candidate

_LAST_STEPS = 3
"""Remaining samples at which a mission plan that does not cover all its demand is replaced; a plain choice."""


@dataclass(frozen=True, eq=False)
class _LawState:
    """The state that the law carries from one step to the next.

    Attributes
    ----------
    plan : the present mission plan; None when there is none.
    former : the mission plan before a fault, whose paths may be reused.
    mode : the present mode.
    history : of thorough searches at rest.
    efficiency : duration of the last plan found at rest, in units of the bound on its work; None before the first.
    """

    plan: Trajectory | None
    former: Trajectory | None
    mode: Mode
    history: ReplanHistory
    efficiency: float | None = None


class RecedingHorizon:
    """The control law of `serve`, `demo` and `simulate`; see `control_law.ControlLaw`.

    Parameters
    ----------
    mission : field, fleet and control parameters.
    backend : native, or the QP back-end of an SQP: piqp, clarabel or osqp.
    seed : kept as an attribute for records; with budgets of counted work the law is deterministic.
    planner : searches for plans; one with that back-end where it is left out.
    """

    tolerates_losses = True

    def __init__(
        self, mission: Mission, *, backend: str = "native", seed: int = 0, planner: Planner | None = None
    ) -> None:
        self.seed = seed
        self._field, self._period = mission.field, mission.spec.control.period_s
        self._substeps = mission.spec.control.substeps
        self._planning_s = mission.spec.control.planning_time_s
        self._constraints = PlanningConstraints(mission)
        self._planner = planner = planner or Planner(backend)
        self._allocation = DemandAllocation(mission.field)
        self._candidates = CandidateGenerator(mission, self._constraints, self._allocation, planner)
        self._improvement = PlanImprovement(mission, self._constraints, self._allocation, planner)
        self._idle = IdleImprovement(mission, self._constraints, self._allocation, planner)
        self._known: tuple[FleetState, DemandMap] | None = None
        self._incumbent: Trajectory | None = None
        self._law_state = _LawState(None, None, Mode.NOMINAL, ReplanHistory(self._planning_s))
        self._proposed: tuple[Trajectory, _LawState] | None = None

    @property
    def mode(self) -> Mode:
        """The present mode; `REPLAN_AT_REST` when steps are too short to find a plan worth flying."""
        return self._law_state.mode

    def published(self, trajectory: Trajectory) -> None:
        """Notify the law that a proposal was sent: it becomes the incumbent, and the state found with it is adopted."""
        self._incumbent = trajectory
        if self._proposed is not None and self._proposed[0] is trajectory:
            self._law_state = self._proposed[1]
        if self._known is not None and self._substeps == 1:
            nominal = self._law_state.mode is Mode.NOMINAL
            self._idle.begin(self._law_state.plan if nominal else None, *self._known)

    def improve(self, budget: Budget) -> bool:
        """Improve the rest of the mission plan between two steps; return whether more time may help."""
        return self._idle.improve(budget)

    def step(self, state: FleetState, coverage: DemandMap, budget: Budget) -> Proposal:
        """Return a proposal from the predicted state on; never raises for numerical reasons.

        For a settled fleet the search is thorough. If the budget is too short for a plan worth flying, the fleet stays
        at rest, and the next search takes twice as long.
        """
        if self._constraints.update(state, self._incumbent):  # earlier plans are for another fleet
            self._law_state = replace(self._law_state, plan=None, former=self._law_state.plan or self._law_state.former)
        underway = None if state.settled else self._incumbent
        self._allocation.update(state, underway, self._constraints.planned, self._period)
        if state.settled:
            budget = budget.extended((self._law_state.history.time_factor - 1.0) * self._planning_s)
        self._known = state, coverage
        others = self._planner.qps_of_others()
        proposal, law = self._decide(state, coverage, budget)
        if (now := self._planner.qps_of_others()) != others:
            proposal = replace(proposal, reason=f"{proposal.reason}; {_fallen_back(others, now)}")
        self._proposed = proposal.trajectory, law
        self._law_state = _if_not_sent(self._law_state, law)
        return proposal

    def _decide(self, state: FleetState, coverage: DemandMap, budget: Budget) -> tuple[Proposal, _LawState]:
        """Return what to propose, and the state of the law once it is sent."""
        law = self._law_state
        rest = None if state.settled else self._improved_rest(self._rest_of(law.plan, state), state, coverage)
        situation = Situation(
            settled=state.settled,
            work_left=bool((coverage.owed & self._constraints.reachable).any()),
            disconnected=self._constraints.disconnected(state),
            disconnected_by_loss=bool(state.lost.any()) and out_of_range(state.position, self._constraints.fleet),
            range_infeasible=self._constraints.range_infeasible,
            on_plan=rest is not None,
        )
        mode = next_mode(law.mode, situation)
        if mode in {Mode.STOP, Mode.REPLAN_AT_REST}:
            reason = "all is covered" if mode is Mode.STOP else "stops to plan at rest"
            proposal = stop_proposal(self._constraints, state, self._incumbent, reason)
        else:
            broken_off = law.plan is not None and rest is None and state.time < law.plan.end_time
            if broken_off and law.mode is not Mode.RENDEZVOUS and not state.settled:
                law = replace(law, former=law.plan)
            law = replace(law, plan=rest)
            law, situation, reason = self._plan(law, mode, situation, state, coverage, budget)
            mode = next_mode(mode, situation)
            if mode is Mode.REPLAN_AT_REST and not state.settled:  # a poor plan is not flown for a whole horizon first
                proposal = stop_proposal(self._constraints, state, self._incumbent, reason)
            else:
                proposal = best_proposal(self._constraints, state, law.plan, self._incumbent, reason)
        if proposal.source is PlanSource.BRAKE:
            mode = next_mode(mode, replace(situation, safe=False))
        history = law.history.after(mode) if state.settled else law.history
        return proposal, replace(law, mode=mode, history=history)

    def _plan(
        self,
        law: _LawState,
        mode: Mode,
        situation: Situation,
        state: FleetState,
        coverage: DemandMap,
        budget: Budget,
    ) -> tuple[_LawState, Situation, str]:
        """Improve the mission plan, or find another one; return state, situation and reason."""
        plan, in_rendezvous = law.plan, law.mode is Mode.RENDEZVOUS
        if plan is not None and not in_rendezvous and not self._runs_out(plan, state, coverage):
            longer = self._extended(plan, state, coverage, budget)
            if longer is not None:
                return replace(law, plan=longer), situation, "extended to what is left"
            plan, reason = self._improvement.improved(plan, state, coverage, self._incumbent, budget)
            return replace(law, plan=plan), situation, reason
        reason = "nothing better was found"
        if mode is Mode.NOMINAL:
            law, situation, reason = self._cover(law, situation, state, coverage, budget)
            mode = next_mode(mode, situation)
        if mode is Mode.RENDEZVOUS:
            law, situation, reason = self._rendezvous(law, situation, state)
            connected = not out_of_range(state.position, self._constraints.fleet)
            if not situation.rendezvous_possible and situation.disconnected and connected:
                law, situation, reason = self._cover(law, situation, state, coverage, budget)
        if not state.settled and self._is_stranded(law, state, coverage, budget):
            stranded, history = law.history.stranded(state.position, float(coverage.residual.sum()))
            law = replace(law, history=history)
            situation = replace(situation, worth_replanning=situation.worth_replanning or stranded)
        return law, situation, reason

    def _cover(
        self, law: _LawState, situation: Situation, state: FleetState, coverage: DemandMap, budget: Budget
    ) -> tuple[_LawState, Situation, str]:
        """Adopt the best plan that is found for the demand, if it is better than to continue as before."""
        best = self._candidates.best(state, coverage, law.former, budget)
        if best is None:
            return law, replace(situation, no_plan_found=law.plan is None), "nothing better was found"
        if best.idle and law.plan is not None and law.mode is not Mode.RENDEZVOUS:
            return law, situation, "no plan was found yet"
        if best.violates_passive_safety and law.plan is not None:
            return law, replace(situation, worth_replanning=True, on_plan=True), "no passively safe plan was found yet"
        found_too_late = best.idle and law.former is not None
        worth = found_too_late or self._is_poor(best, law, state, coverage) or self._is_slow(best, law, state, coverage)
        if state.settled and best.covers and (bound_s := self._work_bound(state, coverage)) > 0.0:
            law = replace(law, efficiency=best.plan.steps * self._period / bound_s)
        situation = replace(situation, worth_replanning=worth, on_plan=True)
        # steps may measure on the way what an extension is for: it is made anew when the end is within the horizon
        plan = best.plan if best.main is None else best.main
        return replace(law, plan=plan, former=None), situation, best.origin.name

    def _rendezvous(self, law: _LawState, situation: Situation, state: FleetState) -> tuple[_LawState, Situation, str]:
        """Continue the rendezvous of groups that are out of range of each other, or find a motion for it."""
        if law.plan is not None:
            return law, situation, "rendezvous"
        no_demand = np.zeros((self._constraints.reachable.shape[0], 0))
        here = (state.position, state.velocity, state.time)
        task = Task(self._constraints.fleet, self._field.cell[:0], no_demand, *here, self._period)
        plans = (guess.motion for guess in Rendezvous().guesses(task))
        plan = next((plan for plan in plans if plan is not None and self._constraints.keeps(plan, state)), None)
        reason = "rendezvous" if plan is not None else "nothing better was found"
        return replace(law, plan=plan), replace(situation, rendezvous_possible=plan is not None), reason

    def _is_poor(self, best: Candidate, law: _LawState, state: FleetState, coverage: DemandMap) -> bool:
        """Return whether a plan leaves most of the demand, so that a longer search is worth while."""
        if best.covers or coverage.endless:
            return False
        demand = self._left_by(self._resting(state), state, coverage)
        return law.history.is_poor(self._left_by(best.plan, state, coverage), demand)

    def _is_slow(self, best: Candidate, law: _LawState, state: FleetState, coverage: DemandMap) -> bool:
        """Return whether a plan for a changed fleet takes longer than to stop and to plan thoroughly would.

        A thorough plan is expected to be as good as the last one, by the bound on the work of the fleet as it is now.
        """
        if state.settled or law.former is None or law.efficiency is None or coverage.endless:
            return False
        fleet = self._constraints.planned
        stop_s = self._planning_s + float((fleet.speed_max / fleet.input_max).max())
        expected_s = law.efficiency * self._work_bound(state, coverage)
        return best.plan.steps * self._period > expected_s + stop_s

    def _work_bound(self, state: FleetState, coverage: DemandMap) -> float:
        """Return about the least time in which the allocated demand can be measured [s]."""
        fleet, field = self._constraints.planned, self._field
        weight, looks = self._allocation.left(coverage, state, state.position[None], fleet.radius)
        demand = weight * self._constraints.reachable, looks
        return work_bound(fleet, field.cell, field.cell_size, demand, state.position)

    def _is_stranded(self, law: _LawState, state: FleetState, coverage: DemandMap, budget: Budget) -> bool:
        """Return whether a fleet at rest has found no plan that moves it in time, though demand is outstanding."""
        here, plan = state.position, law.plan
        in_time = budget.left_s > -self._period
        later = plan if plan is not None and in_time else self._resting(state)
        if state.velocity.any() or not stays_at(later.position, here):
            return False
        return bool((self._left_by(later, state, coverage) > 0.0).any())

    def _runs_out(self, plan: Trajectory, state: FleetState, coverage: DemandMap) -> bool:
        """Return whether a mission plan has covered its demand, or is about to end, while more is outstanding."""
        if coverage.endless:
            return not coverage.demand(state.time, state.position).gamma.any()
        if plan.steps > _LAST_STEPS * self._substeps:
            return False
        _, looks = self._allocation.left(coverage, state, plan.position, self._constraints.planned.radius)
        left = self._left_by(plan, state, coverage)
        return self._allocation.more or (looks is not None and bool((left > 0.0).any()))

    def _extended(self, plan: Trajectory, state: FleetState, coverage: DemandMap, budget: Budget) -> Trajectory | None:
        """Return a mission plan that ends within the horizon and leaves demand, extended to it; None where that fails.

        A fleet that waited until its plan has ended would stop, and search in the time of one step.
        """
        if coverage.endless or plan.steps > self._constraints.horizon:
            return None
        if not (self._left_by(plan, state, coverage) > 0.0).any():
            return None
        return self._candidates.extended(plan, state, coverage, budget)

    def _rest_of(self, plan: Trajectory | None, state: FleetState) -> Trajectory | None:
        """Return the rest of the mission plan from this state on, or None if it is over or violates the constraints."""
        if plan is None:
            return None
        done = round((state.time - plan.start_time) / self._period)
        if not 0 <= done < plan.steps:
            return None
        rest = state.trajectory(plan.velocity[done + 1 :], self._period)
        return rest if self._constraints.keeps(rest, state) else None

    def _improved_rest(self, rest: Trajectory | None, state: FleetState, coverage: DemandMap) -> Trajectory | None:
        """Return what was found in the idle time if it is shorter, as safe, and covers no less; else the rest."""
        found = self._idle.taken(state.time)
        if rest is None or found is None or found.steps >= rest.steps:
            return rest
        shorter = state.trajectory(found.velocity[1:], self._period)
        if (self._left_by(shorter, state, coverage) > self._left_by(rest, state, coverage)).any():
            return rest
        return shorter if self._improvement.is_safe(shorter, rest, state, self._incumbent) else rest

    def _resting(self, state: FleetState) -> Trajectory:
        """Return the motion that stays where the fleet is, of one sample."""
        return Trajectory.at_rest(state.position, state.time, self._period, 0)

    def _left_by(self, later: Trajectory, state: FleetState, coverage: DemandMap) -> FloatArray:
        """Return the weights (J, K) of the allocated demand that a later motion does not cover."""
        fleet = self._constraints.planned
        between = inter_sample(later, fleet.look_instants)
        weight, _ = self._allocation.left(coverage, state, later.position, fleet.radius, between)
        return weight * self._constraints.reachable


def _fallen_back(before: Mapping[str, int], now: Mapping[str, int]) -> str:
    """Return in words which back-ends answered how many QPs in place of the chosen one."""
    more = {name: count - before.get(name, 0) for name, count in now.items()}
    return "QPs answered by others: " + ", ".join(f"{name} {count}" for name, count in more.items() if count)


def _if_not_sent(present: _LawState, found: _LawState) -> _LawState:
    """Return the state of the law if a proposal is not sent: unchanged, but for what remains true of what was found.

    The paths of its plan may be reused later, and steps remain too short where they were found to be.
    """
    former = found.plan if found.mode is Mode.NOMINAL else found.former
    mode = Mode.REPLAN_AT_REST if found.mode is Mode.REPLAN_AT_REST else present.mode
    return replace(present, former=former or present.former, mode=mode)
