"""The receding-horizon step: the segment of the mission plan within the horizon is optimised from the newest state.

Cells that the segment passes, and to which the plan would come back at its end, are taken in passing if possible. Else
a segment that covers all its demand is shortened by a sample; another one is improved in coverage. The result is
accepted only if it is as safe as the known plan, also when an agent misses the message or stops without warning.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.control.horizon import horizon_ocp, optimised_steps, spliced
from mpc_cover.coverage.nearest import remaining_weight
from mpc_cover.model.look_instants import inter_sample
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.scp import BRAKING_TOLERANCE
from mpc_cover.planning.segment_refinement import resampled

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.control.demand_allocation import DemandAllocation
    from mpc_cover.control.planning_constraints import PlanningConstraints
    from mpc_cover.information.demand import DemandMap
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.fleet_constraints import FleetConstraints
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.planner import Planner
    from mpc_cover.planning.scp import SCPResult

_MAX_QPS = 1
"""QPs per step; a plain choice that leaves the rest of the budget for replanning."""
_BUDGET_SHARE = 0.3
"""Part of the budget of a step that improvement may use; a plain choice, enough for a plan that is good already."""
_MIN_STEPS = 2
"""Segments of no more than so many samples are not shortened; a plain choice."""
_TAIL_SHARE, _STRAGGLERS_SHARE = 0.1, 0.02
"""The last part of a mission plan, and the part of all cells that it alone covers, at which that is a way back to cells
left behind. Plain choices: regular work covers its share of the cells."""
_PASSED_RADII = 1.5
"""Distance in sensing radii at which a segment passes a cell; a plain choice of what a small detour reaches."""


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
        self._substeps = mission.spec.control.substeps
        self._constraints, self._allocation, self._planner = constraints, allocation, planner

    def improved(
        self, plan: Trajectory, state: FleetState, coverage: DemandMap, incumbent: Trajectory | None, budget: Budget
    ) -> tuple[Trajectory, str]:
        """Return the mission plan with its first segment improved, or unchanged, and which of the two, in words.

        `plan` begins in `state`; `incumbent` is the trajectory that was sent last.
        """
        fleet, parts = self._constraints.planned, self._substeps
        plan = _of_whole_steps(plan, parts)
        segment = optimised_steps(plan, fleet, self._constraints.horizon)
        segment = max(segment // parts, 1) * parts
        if parts == 1:
            taken = self._taken_in_passing(plan, segment, state, coverage, incumbent, budget)
            if taken is not None:
                return taken, "cells taken in passing"
        # unless the plan ends there, the segment's end is given: the rest of the plan takes what is passed from it on
        rest = plan.slice(segment, plan.steps)
        between = inter_sample(rest, fleet.look_instants) if rest.steps else None
        later = plan.position[segment + (between is None) :]
        weight, looks = self._allocation.left(coverage, state, later, fleet.radius, between)
        demand = weight * self._constraints.reachable, looks
        ocp = horizon_ocp(plan, fleet, self._cell, demand, segment, segment)
        x = ocp.decision(plan.position[0], plan.velocity[: segment + 1])
        now = self._planner.evaluate(ocp, x)
        steps, safe = segment // parts, now.braking_violation <= BRAKING_TOLERANCE
        sooner = now.cost == 0.0 and steps > _MIN_STEPS
        if not (sooner and safe):
            found, improved = self._resolved(plan, fleet, demand, segment, steps, budget)
            if found.feasible and found.merit < now.merit and self.is_safe(improved, plan, state, incumbent):
                return improved, "more coverage"
        if not sooner:
            return plan, "no better"
        # a plan that cannot be made passively safe is shortened as it is, if it does not become less safe
        bounds = fleet if safe else replace(fleet, reaction_periods=0.0)
        found, improved = self._resolved(plan, bounds, demand, segment, steps - 1, budget)
        if found.complete and self.is_safe(improved, plan, state, incumbent):
            return improved, "a sample sooner"
        return plan, "no sample sooner"

    def _resolved(
        self,
        plan: Trajectory,
        fleet: FleetConstraints,
        demand: tuple[FloatArray, IntArray | None],
        segment: int,
        steps: int,
        budget: Budget,
    ) -> tuple[SCPResult, Trajectory]:
        """Return the solution of the segment in so many steps of plans, and the plan with it."""
        parts = self._substeps
        bounds = self._constraints.in_steps(fleet)
        ocp = horizon_ocp(plan, bounds, self._cell, demand, segment, steps, period=plan.period * parts)
        x = ocp.decision(plan.position[0], resampled(plan.velocity[: segment + 1 : parts], steps))
        found = self._planner.polish(ocp, ocp.exact_ends(x) if parts > 1 else x, _MAX_QPS, budget.part(_BUDGET_SHARE))
        position, velocity = ocp.motion(found.x)
        start = position[0], velocity[0]
        motion = Trajectory.from_velocities(*start, velocity[1:], plan.start_time, ocp.period)
        return found, spliced(plan, motion.subdivided(parts).velocity, segment)

    def _taken_in_passing(
        self,
        plan: Trajectory,
        segment: int,
        state: FleetState,
        coverage: DemandMap,
        incumbent: Trajectory | None,
        budget: Budget,
    ) -> Trajectory | None:
        """Return the plan with a segment that also covers what the plan would come back for, or None.

        Where that is all that it would come back for, the segment may take a sample more: the way back is longer.
        """
        fleet, begin = self._constraints.planned, plan.steps - round(_TAIL_SHARE * plan.steps)
        if segment >= begin:
            return None
        before_tail, looks = self._allocation.left(coverage, state, plan.position[segment + 1 : begin], fleet.radius)
        if looks is not None:
            return None
        owed = before_tail * self._constraints.reachable
        late = remaining_weight(plan.position[: segment + 1], self._cell, fleet.radius, owed)
        few = max(1, round(_STRAGGLERS_SHARE * self._cell.shape[0]))
        if not 0 < np.count_nonzero(late) <= few:
            return None
        passed = self._passed(plan, segment, late)
        if not (late * passed).any():
            return None
        demand = np.where((late > 0.0) & ~passed, 0.0, owed), None
        all_passed = not (late * ~passed).any()
        for steps in (segment, segment + 1) if all_passed else (segment,):
            ocp = horizon_ocp(plan, fleet, self._cell, demand, segment, steps)
            x = ocp.decision(plan.position[0], resampled(plan.velocity[: segment + 1], steps))
            found = self._planner.polish(ocp, x, _MAX_QPS, budget.part(_BUDGET_SHARE))
            if found.complete:
                taken = spliced(plan, ocp.motion(found.x)[1], segment)
                if self.is_safe(taken, plan, state, incumbent):
                    return taken
        return None

    def _passed(self, plan: Trajectory, segment: int, late: FloatArray) -> BoolArray:
        """Return (J, K): the cells of `late` (J, K) that an agent which can measure them passes in the segment."""
        radius = _PASSED_RADII * self._constraints.planned.radius
        left = remaining_weight(plan.position[: segment + 1], self._cell, radius, late)
        return np.asarray((late > 0.0) & (left == 0.0))

    def is_safe(self, plan: Trajectory, known: Trajectory, state: FleetState, incumbent: Trajectory | None) -> bool:
        """Return whether a plan satisfies the bounds, also if an agent misses it, and is passively safe."""
        constraints = self._constraints
        return (
            constraints.keeps(plan, state)
            and constraints.safe_if_missed(plan, known)
            and self._is_apart(plan, known, state, incumbent)
            and constraints.keeps_passive_safety(plan, known, self._state_before(state, incumbent))
        )

    def _is_apart(self, plan: Trajectory, known: Trajectory, state: FleetState, incumbent: Trajectory | None) -> bool:
        """Return whether a plan keeps away from what others may hold, or does so no less than the known one."""
        horizon, apart = self._constraints.horizon, self._constraints.apart_from_held
        ours, theirs = (one.slice(0, min(one.steps, horizon)) for one in (plan, known))
        return apart(ours, state, incumbent) or (
            not apart(theirs, state, incumbent) and apart(ours, state, incumbent, eased=True)
        )

    def _state_before(self, state: FleetState, incumbent: Trajectory | None) -> tuple[FloatArray, FloatArray] | None:
        """Return the incumbent's state (m, d) [m], [m/s] a period earlier; None outside its time span."""
        if incumbent is None:
            return None
        sample = round((state.time - self._period - incumbent.start_time) / self._period)
        return (incumbent.position[sample], incumbent.velocity[sample]) if 0 <= sample <= incumbent.steps else None


def _of_whole_steps(plan: Trajectory, parts: int) -> Trajectory:
    """Return a plan whose samples make whole steps of `parts` samples: it rests a little longer at its end."""
    missing = -plan.steps % parts
    if missing == 0:
        return plan
    rest = np.repeat(plan.velocity[-1:], missing, axis=0)
    return spliced(plan, np.concatenate([plan.velocity, rest]), plan.steps)
