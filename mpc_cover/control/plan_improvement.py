"""The receding-horizon step: the segment of the mission plan within the horizon is optimised from the newest state.

A segment that covers all its demand is shortened by a sample; another one is improved in coverage. The result is
accepted only if it is as safe as the known plan, also when an agent misses the message or stops without warning.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpc_cover.control.horizon import horizon_ocp, optimised_steps, spliced
from mpc_cover.planning.scp import BRAKING_TOLERANCE
from mpc_cover.planning.segment_refinement import resampled

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.control.demand_allocation import DemandAllocation
    from mpc_cover.control.planning_constraints import PlanningConstraints
    from mpc_cover.information.demand import DemandMap
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.planner import Planner

_MAX_QPS = 2
"""QPs per step; a plain choice that leaves the rest of the budget for replanning."""
_BUDGET_SHARE = 0.3
"""Part of the budget of a step that improvement may use; a plain choice, enough for a plan that is good already."""
_MIN_STEPS = 2
"""Segments of no more than so many samples are not shortened; a plain choice."""


class PlanImprovement:
    """Improves the mission plan by one receding-horizon step at a time.

    Parameters
    ----------
    mission : provides cells and period.
    constraints, allocation : of the plans, and of demand to them.
    planner : solves the OCPs.
    """

    def __init__(
        self, mission: Mission, constraints: PlanningConstraints, allocation: DemandAllocation, planner: Planner
    ) -> None:
        self._cell, self._period = mission.field.cell, mission.spec.control.period_s
        self._constraints, self._allocation, self._planner = constraints, allocation, planner

    def improved(
        self, plan: Trajectory, state: FleetState, coverage: DemandMap, incumbent: Trajectory | None, budget: Budget
    ) -> tuple[Trajectory, str]:
        """Return the mission plan with its first segment improved, or unchanged, and which of the two, in words.

        `plan` begins in `state`; `incumbent` is the trajectory that was sent last.
        """
        fleet = self._constraints.planned
        segment = optimised_steps(plan, fleet, self._constraints.horizon)
        later = plan.position[segment + 1 :]
        weight, looks = self._allocation.left(coverage, state, later, fleet.radius)
        demand = weight * self._constraints.reachable, looks
        ocp = horizon_ocp(plan, fleet, self._cell, demand, segment, segment)
        x = ocp.decision(plan.position[0], plan.velocity[: segment + 1])
        now = self._planner.evaluate(ocp, x)
        sooner = now.cost == 0.0 and now.braking_violation <= BRAKING_TOLERANCE and segment > _MIN_STEPS
        if sooner:
            ocp = horizon_ocp(plan, fleet, self._cell, demand, segment, segment - 1)
            x = ocp.decision(plan.position[0], resampled(plan.velocity[: segment + 1], segment - 1))
        found = self._planner.polish(ocp, x, _MAX_QPS, budget.part(_BUDGET_SHARE))
        better = found.complete if sooner else found.merit < now.merit
        if found.feasible and better:
            improved = spliced(plan, ocp.motion(found.x)[1], segment)
            if self._is_safe(improved, plan, state, incumbent):
                return improved, "a sample sooner" if sooner else "more coverage"
        return plan, "no sample sooner" if sooner else "no better"

    def _is_safe(self, plan: Trajectory, known: Trajectory, state: FleetState, incumbent: Trajectory | None) -> bool:
        """Return whether a plan satisfies the bounds, also if an agent misses it, and is passively safe."""
        constraints = self._constraints
        return (
            constraints.keeps(plan, state)
            and constraints.safe_if_missed(plan, known)
            and constraints.keeps_passive_safety(plan, known, self._state_before(state, incumbent))
        )

    def _state_before(self, state: FleetState, incumbent: Trajectory | None) -> tuple[FloatArray, FloatArray] | None:
        """Return the incumbent's state (m, d) [m], [m/s] a period earlier; None outside its time span."""
        if incumbent is None:
            return None
        sample = round((state.time - self._period - incumbent.start_time) / self._period)
        return (incumbent.position[sample], incumbent.velocity[sample]) if 0 <= sample <= incumbent.steps else None
