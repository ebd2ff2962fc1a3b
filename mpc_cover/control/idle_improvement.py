"""Improvement of the rest of the mission plan in the idle time between control steps.

A step has time for the segment within the horizon. What is left of its period is used to look for a motion that covers
all that the plan covers from its next sample on, in fewer samples. What was found is taken at the next step if it is as
safe as the plan from the state that the fleet is in by then.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from mpc_cover.control.horizon import horizon_ocp
from mpc_cover.model.look_instants import inter_sample
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.scp import BRAKING_TOLERANCE
from mpc_cover.planning.segment_refinement import flown_in_steps

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.control.demand_allocation import DemandAllocation
    from mpc_cover.control.planning_constraints import PlanningConstraints
    from mpc_cover.information.demand import DemandMap
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.fleet_constraints import FleetConstraints
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.planner import Planner
    from mpc_cover.planning.shortening import Shortening

_HOPS_MAX = 4
"""Descents in a row in vain after which the rest of a period is left alone; a plain choice: plans that were thoroughly
searched for are seldom shortened, those made in a hurry mostly by the first of them."""
_STEPS_MIN = 4
"""Samples below which a rest is not shortened; a plain choice."""


@dataclass(frozen=True, eq=False)
class _Rest:
    """What is to be shortened: the plan from its sample 1 on, its bounds, and the weights and looks that it covers."""

    motion: Trajectory
    fleet: FleetConstraints
    demand: tuple[FloatArray, IntArray | None]


class IdleImprovement:
    """Shortens the rest of one mission plan after the other.

    Parameters
    ----------
    mission : provides cells and period.
    constraints, allocation : of the plans, and of demand to them.
    planner : searches for shorter motions.
    """

    def __init__(
        self, mission: Mission, constraints: PlanningConstraints, allocation: DemandAllocation, planner: Planner
    ) -> None:
        self._cell, self._planner = mission.field.cell, planner
        self._constraints, self._allocation = constraints, allocation
        self._given: tuple[Trajectory, FleetState, DemandMap] | None = None
        self._rest: _Rest | None = None
        self._search: Shortening | None = None
        self._found: Trajectory | None = None
        self._hops = 0

    def begin(self, plan: Trajectory | None, state: FleetState, coverage: DemandMap) -> None:
        """Start over with a mission plan from a state on, which was sent; None for nothing to do."""
        self._given = None if plan is None or plan.steps <= _STEPS_MIN else (plan, state, coverage)
        self._rest, self._search, self._found, self._hops = None, None, None, 0

    def improve(self, budget: Budget) -> bool:
        """Search within a budget; return whether more time may help."""
        if self._given is not None:
            self._rest, self._given = self._begun(*self._given), None
        while self._rest is not None and not budget.exhausted:
            if self._search is None:
                self._search = self._shortening(self._rest, self._found or self._rest.motion)
            if self._search is None:
                self._rest = None
                break
            self._hops += 1
            if (velocity := self._search.hop(budget)) is None:
                if self._hops >= _HOPS_MAX:
                    self._rest = None
            else:
                motion = self._rest.motion
                start = motion.position[0], velocity[0]
                self._found = Trajectory.from_velocities(*start, velocity[1:], motion.start_time, motion.period)
                self._search, self._hops = None, 0
        return self._rest is not None

    def taken(self, time_s: float) -> Trajectory | None:
        """Return what was found for a plan that begins at a mission time [s], and forget it; None for nothing."""
        found, self._found = self._found, None
        begins = found is not None and abs(found.start_time - time_s) < 0.5 * found.period
        self._given, self._rest, self._search = None, None, None
        return found if begins else None

    def _begun(self, plan: Trajectory, state: FleetState, coverage: DemandMap) -> _Rest | None:
        """Return the rest of a plan that covers all its demand, or None."""
        fleet, first = self._constraints.planned, plan.slice(0, 1)
        between = inter_sample(first, fleet.look_instants)
        # the rest's own samples begin with the plan's sample 1
        passed = first.position if between is not None else first.position[:1]
        weight, looks = self._allocation.left(coverage, state, passed, fleet.radius, between)
        rest = _Rest(plan.slice(1, plan.steps), fleet, (weight * self._constraints.reachable, looks))
        ocp = horizon_ocp(rest.motion, fleet, self._cell, rest.demand, rest.motion.steps, rest.motion.steps)
        now = self._planner.evaluate(ocp, ocp.decision_of(rest.motion))
        if now.cost > 0.0 or not self._planner.descends_natively(ocp):
            return None
        # a plan that is not passively safe is shortened as it is
        safe = now.braking_violation <= BRAKING_TOLERANCE
        return rest if safe else replace(rest, fleet=replace(fleet, reaction_periods=0.0))

    def _shortening(self, rest: _Rest, motion: Trajectory) -> Shortening | None:
        """Return the search for a motion a sample shorter than one that covers the rest's demand."""
        steps = motion.steps - 1
        if steps < _STEPS_MIN:
            return None
        ocp = horizon_ocp(rest.motion, rest.fleet, self._cell, rest.demand, rest.motion.steps, steps)
        return self._planner.shortening(ocp, flown_in_steps(ocp, motion.position, motion.velocity))
