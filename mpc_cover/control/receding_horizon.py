"""The receding-horizon controller: it knows the rest of the mission and refines the stretch ahead.

A plan for the whole mission is made before anyone moves. Each step re-solves the stretch within the horizon
from the newest state, asking for the same coverage a sample sooner, and splices it into the mission plan.
What is published is that stretch, ended at rest and verified.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from mpc_cover.control.candidate_generation import CandidateGenerator
from mpc_cover.control.demand_allocation import DemandAllocation
from mpc_cover.control.fallback_policy import FallbackPolicy, StepResult
from mpc_cover.control.horizon import horizon_ocp, resolved_steps, spliced
from mpc_cover.control.planning_constraints import PlanningConstraints
from mpc_cover.control.replan_trigger import ReplanTrigger, stays_at
from mpc_cover.information.build import make_map
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.planning.budget import part_of
from mpc_cover.planning.initial_guess.rendezvous import out_of_range, rendezvous_plans
from mpc_cover.planning.planner import Planner
from mpc_cover.planning.scp import BRAKING_TOLERANCE
from mpc_cover.planning.segment_refinement import resampled

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.control.fallback_policy import PlanSource
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.task import Candidate, Task

_QPS = 2
"""QPs a step at the most: the rest of the budget is for what goes wrong."""
_SHARE = 0.3
"""Part of the time for a step that polishing may take: a plan that is good already needs no more."""
_LAST = 3
"""So few samples before its end a mission plan that leaves something owed gives way to the next."""


class RecedingHorizon:
    """The brain of the daemon and of the simulation.

    Parameters
    ----------
    mission : what to cover, with whom.
    backend : QP back-end: piqp, clarabel or osqp.
    seed : of whatever is random; the controller itself is deterministic without deadlines.

    Attributes
    ----------
    coverage : what was measured, and what is owed.
    """

    def __init__(self, mission: Mission, *, backend: str = "piqp", seed: int = 0) -> None:
        self._constraints = PlanningConstraints(mission)
        self._mission = self._constraints.mission
        self._period = mission.spec.control.period_s
        self._planner = Planner(backend)
        self.seed = seed
        self.coverage = make_map(mission)
        self._allocation = DemandAllocation(self.coverage, mission.field)
        self._trigger = ReplanTrigger(mission.spec.control.planning_time_s)
        self._whole: Trajectory | None = None
        self._reunites = False
        self._fallback = FallbackPolicy(self._constraints)
        self._candidates = CandidateGenerator(mission, self._constraints, self._allocation)

    @property
    def wants_replan_at_rest(self) -> bool:
        """Whether the fleet should rest for a thorough plan (`prepare`): steps are too short, or find none."""
        return self._trigger.wanted

    @property
    def unreachable(self) -> BoolArray:
        """(J, K): what is owed, but cannot be measured by any of those who are left."""
        return self.coverage.owed & ~self._constraints.measurable

    def prepare(
        self, position: FloatArray, velocity: FloatArray, start_time: float, *, deadline: float | None
    ) -> StepResult:
        """Plan the whole mission from (m, d) `position` [m], thoroughly, and return its first stretch.

        For a fleet at rest; `deadline` is on `time.perf_counter`. Without one the mission's planning time bounds the
        work instead of the time, and the plan is the same every time. Whenever that is too short for a plan worth
        flying, the fleet stays at rest, and the next planning takes twice as long.
        """
        begun = time.perf_counter()
        start = self._begin(position, velocity, start_time)
        if self._nothing_left:
            return self._result(begun, deadline, *self._fallback.stop(start, self._why_stop))
        planning_s, self._whole = self._mission.spec.control.planning_time_s, None
        effort_s = planning_s * self._trigger.patience
        later = None if deadline is None else deadline + effort_s - planning_s
        self._trigger.begin()
        reason = self._replan(start, later, partial(self._planner.whole, effort_s=effort_s))
        self._trigger.end()
        return self._result(begun, later, *self._fallback.best(start, self._whole, reason))

    def step(
        self, position: FloatArray, velocity: FloatArray, start_time: float, *, deadline: float | None
    ) -> StepResult:
        """Return the plan from the predicted (m, d) state at `start_time` on; never raises for numerical trouble."""
        begun = time.perf_counter()
        start = self._begin(position, velocity, start_time)
        if self.wants_replan_at_rest or (self._nothing_left and not self._constraints.parted(start)):
            return self._result(begun, deadline, *self._fallback.stop(start, self._why_stop))
        known, self._whole = self._whole, self._rest_of_whole(start)
        if self._whole is None and known is not None and not self._reunites and start.time < known.end_time:
            self._candidates.former = known
        if self._whole is None or self._reunites or self._runs_out(self._whole, start):
            reason = self._replan(start, deadline, self._planner.quick)
            self._notice_loss(start, deadline)
        else:
            self._whole, reason = self._improved(self._whole, start, deadline)
        return self._result(begun, deadline, *self._fallback.best(start, self._whole, reason))

    def set_lost(self, lost: BoolArray) -> None:
        """Go on without the agents of the (m,) mask, or with them again; the work is shared out anew.

        They stand still where the next step says they are, as obstacles. What only they could measure stays owed.
        """
        if self._constraints.set_lost(lost):
            self._start_over()

    def set_obstacles(self, obstacles: Mapping[int, Trajectory]) -> None:
        """Keep clear of the lost while they still move, by number; without one they are where they come to rest."""
        self._constraints.obstacles = obstacles

    def limit_speed(self, index: int, share: float) -> None:
        """Plan for an agent that reaches only this share of its speed."""
        if self._constraints.limit_speed(index, share):
            self._start_over()

    def _start_over(self) -> None:
        self._mission = self._constraints.mission
        self._candidates.former, self._whole = self._whole or self._candidates.former, None

    def _begin(self, position: FloatArray, velocity: FloatArray, start_time: float) -> FleetState:
        start = FleetState(position, velocity, start_time)
        self._constraints.take(start, self._fallback.published)
        self._mission = self._constraints.mission
        return start

    @property
    def _nothing_left(self) -> bool:
        return not (self.coverage.owed & self._constraints.measurable).any()

    @property
    def _why_stop(self) -> str:
        return "all is covered" if self._nothing_left else "stops to think"

    def _replan(
        self, start: FleetState, deadline: float | None, search: Callable[[Task, float | None], Candidate]
    ) -> str:
        """Plan what is owed from here, and say how; those whom a loss leaves out of range of each other meet first."""
        constraints = self._constraints
        parts = out_of_range(start.position, constraints.fleet) or constraints.parting
        if not parts and (kind := self._cover(start, deadline, search)):
            return kind
        if self._whole is None and (parts or constraints.torn):
            plans = rendezvous_plans(start, constraints.fleet, self._period)
            self._whole = next((plan for plan in plans if constraints.keeps(plan, start)), None)
            self._reunites = self._whole is not None
        if self._reunites:
            return "meets again"
        in_touch = parts and not out_of_range(start.position, constraints.fleet)
        return (self._cover(start, deadline, search) if in_touch else None) or "nothing better was found"

    def _cover(
        self, start: FleetState, deadline: float | None, search: Callable[[Task, float | None], Candidate]
    ) -> str | None:
        """Take the best plan that is found for what is owed, and return of what kind it is; None if none is."""
        if (best := self._candidates.best(start, deadline, search, self._planner)) is None:
            return None
        idle = best.kind == "rest" and best.cost > 0.0
        if idle and self._whole is not None and not self._reunites:
            return "no way on was found yet"
        in_a_hurry = idle and deadline is not None and self._candidates.former is not None
        self._trigger.wanted = in_a_hurry or self._is_poor(best, start)
        self._whole, self._reunites, self._candidates.former = best.plan, False, None
        return best.kind

    def _is_poor(self, best: Candidate, start: FleetState) -> bool:
        """Return whether a plan leaves most of what is owed, so that longer planning is worth while."""
        if best.covers or self.coverage.endless:
            return False
        owed, _ = self._left_by(start.position[None], start)
        left, _ = self._left_by(best.plan.position, start)
        return self._trigger.is_poor(left, owed)

    def _notice_loss(self, start: FleetState, deadline: float | None) -> None:
        """See whether a fleet at rest finds no way on in time."""
        here, plan = start.position, self._whole
        in_time = deadline is None or time.perf_counter() <= deadline + self._period
        seen = plan.position if plan is not None and in_time else here[None]
        if not start.velocity.any() and stays_at(seen, here) and (self._left_by(seen, start)[0] > 0.0).any():
            self._trigger.strand(here, float(self.coverage.residual.sum()))

    def _runs_out(self, whole: Trajectory, start: FleetState) -> bool:
        """Return whether a mission plan has done its part, or is about to end, while more is to be done."""
        if self.coverage.endless:
            return not self.coverage.demand(start.time, start.position).gamma.any()
        if whole.steps > _LAST:
            return False
        weight, looks = self._left_by(whole.position, start)
        return self._allocation.more or (looks is not None and bool((weight > 0.0).any()))

    def _rest_of_whole(self, start: FleetState) -> Trajectory | None:
        """Return what is left of the mission plan from this state on, or None when it is over or of no use."""
        whole = self._whole
        if whole is None:
            return None
        done = round((start.time - whole.start_time) / self._period)
        if not 0 <= done < whole.steps:
            return None
        rest = start.trajectory(whole.velocity[done + 1 :], self._period)
        return rest if self._constraints.keeps(rest, start) else None

    def _improved(self, whole: Trajectory, start: FleetState, deadline: float | None) -> tuple[Trajectory, str]:
        """Re-solve the stretch within the horizon, a sample shorter if all that was to be covered still is."""
        stretch = resolved_steps(whole, self._mission)
        weight, looks = self._left_by(whole.position[stretch + 1 :], start)
        ocp = replace(horizon_ocp(whole, self._mission, weight, stretch, stretch), looks=looks)
        x = ocp.decision(whole.position[0], whole.velocity[: stretch + 1])
        now = self._planner.evaluate(ocp, x)
        sooner = int(now.cost == 0.0 and now.braking_violation <= BRAKING_TOLERANCE and stretch > 2)  # noqa: PLR2004 - no less to gain
        if sooner:
            ocp = replace(horizon_ocp(whole, self._mission, weight, stretch, stretch - 1), looks=looks)
            x = ocp.decision(whole.position[0], resampled(whole.velocity[: stretch + 1], stretch - 1))
        found = self._planner.polish(ocp, x, _QPS, part_of(deadline, _SHARE))
        better = found.complete if sooner else found.merit < now.merit
        if found.feasible and better:
            plan = spliced(whole, ocp.motion(found.x)[1], stretch)
            if self._is_safe(plan, whole, start):
                return plan, "a sample sooner" if sooner else "more coverage"
        return whole, "no sample sooner" if sooner else "no better"

    def _is_safe(self, plan: Trajectory, known: Trajectory, start: FleetState) -> bool:
        """Return whether a plan is as safe as the known one, whoever misses it, and whoever stops."""
        constraints = self._constraints
        before = self._fallback.state_at(start.time - self._period)
        return (
            constraints.keeps(plan, start)
            and constraints.keeps_if_missed(plan, known)
            and constraints.leaves_room(plan, known, before)
        )

    def _left_by(self, later: FloatArray, start: FleetState) -> tuple[FloatArray, IntArray | None]:
        """Return weights and looks (J, K) of what is asked for and not brought by later positions of the plan."""
        weight, looks = self._allocation.left(start, later, self._mission.fleet.radius)
        return weight * self._constraints.measurable, looks

    def _result(
        self, begun: float, deadline: float | None, plan: Trajectory, plan_source: PlanSource, reason: str
    ) -> StepResult:
        self._fallback.published = plan
        now = time.perf_counter()
        return StepResult(plan, plan_source, reason, now - begun, deadline is not None and now > deadline)
