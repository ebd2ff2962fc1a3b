"""The receding-horizon step proper: the segment within the horizon is solved again, from the newest state.

If all that it was to cover is covered, in a sample less; else for more coverage. What comes out is taken only if it is
as safe as the plan that is known, whoever misses the message, and whoever stops without warning.
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
    from mpc_cover.information.demand import FlownMap
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.planner import Planner

_QPS = 2
"""QPs a step at the most: the rest of the budget is for what goes wrong."""
_SHARE = 0.3
"""Part of the budget of a step that it may take: a plan that is good already needs no more."""
_SHORTEST = 2
"""So few samples there is nothing to gain in."""


class PlanImprovement:
    """Improves the mission plan, a step at a time.

    Parameters
    ----------
    mission : whose cells, and how long a period is.
    constraints, allocation : what plans are held to, and what they are to bring.
    planner : solves.
    """

    def __init__(
        self, mission: Mission, constraints: PlanningConstraints, allocation: DemandAllocation, planner: Planner
    ) -> None:
        self._cell, self._period = mission.field.cell, mission.spec.control.period_s
        self._constraints, self._allocation, self._planner = constraints, allocation, planner

    def improved(
        self, plan: Trajectory, state: FleetState, coverage: FlownMap, incumbent: Trajectory | None, budget: Budget
    ) -> tuple[Trajectory, str]:
        """Return the mission plan with its first segment solved again, or as it is; and which, in words.

        `plan` begins in `state`; `incumbent` is what was sent last.
        """
        fleet = self._constraints.planned
        segment = optimised_steps(plan, fleet, self._constraints.horizon)
        later = plan.position[segment + 1 :]
        weight, looks = self._allocation.left(coverage, state, later, fleet.radius)
        owed = weight * self._constraints.reachable, looks
        ocp = horizon_ocp(plan, fleet, self._cell, owed, segment, segment)
        x = ocp.decision(plan.position[0], plan.velocity[: segment + 1])
        now = self._planner.evaluate(ocp, x)
        sooner = now.cost == 0.0 and now.braking_violation <= BRAKING_TOLERANCE and segment > _SHORTEST
        if sooner:
            ocp = horizon_ocp(plan, fleet, self._cell, owed, segment, segment - 1)
            x = ocp.decision(plan.position[0], resampled(plan.velocity[: segment + 1], segment - 1))
        found = self._planner.polish(ocp, x, _QPS, budget.part(_SHARE))
        better = found.complete if sooner else found.merit < now.merit
        if found.feasible and better:
            improved = spliced(plan, ocp.motion(found.x)[1], segment)
            if self._is_safe(improved, plan, state, incumbent):
                return improved, "a sample sooner" if sooner else "more coverage"
        return plan, "no sample sooner" if sooner else "no better"

    def _is_safe(self, plan: Trajectory, known: Trajectory, state: FleetState, incumbent: Trajectory | None) -> bool:
        """Return whether a plan is as safe as the known one, whoever misses it, and whoever stops."""
        constraints = self._constraints
        return (
            constraints.keeps(plan, state)
            and constraints.safe_if_missed(plan, known)
            and constraints.keeps_passive_safety(plan, known, self._state_before(state, incumbent))
        )

    def _state_before(self, state: FleetState, incumbent: Trajectory | None) -> tuple[FloatArray, FloatArray] | None:
        """Return the state (m, d) [m], [m/s] that the incumbent has a period earlier; None outside of it."""
        if incumbent is None:
            return None
        sample = round((state.time - self._period - incumbent.start_time) / self._period)
        return (incumbent.position[sample], incumbent.velocity[sample]) if 0 <= sample <= incumbent.steps else None
