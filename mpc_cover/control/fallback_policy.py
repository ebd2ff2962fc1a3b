"""What is flown when there is no new plan: the plan published last, shifted; and if that does not hold, the brake."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpc_cover.control.control_law import PlanSource, Proposal
from mpc_cover.control.horizon import ended_at_rest

if TYPE_CHECKING:
    from mpc_cover.control.planning_constraints import PlanningConstraints
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory


def best_proposal(
    constraints: PlanningConstraints,
    state: FleetState,
    plan: Trajectory | None,
    incumbent: Trajectory | None,
    reason: str,
) -> Proposal:
    """Cut the horizon out of the mission plan, end it at rest, verify it; else fall back on the incumbent, or brake."""
    if plan is not None:
        for beginning in ended_at_rest(plan, constraints.planned, constraints.horizon):
            if constraints.keeps(beginning, state):
                return Proposal(beginning, PlanSource.NEW, reason)
    reason = "no new plan passed the verifier"
    shifted = _shifted(constraints, state, incumbent)
    return Proposal(shifted, PlanSource.SHIFTED, reason) if shifted else _brake(constraints, state, reason)


def stop_proposal(
    constraints: PlanningConstraints, state: FleetState, incumbent: Trajectory | None, reason: str
) -> Proposal:
    """Come to rest: at once if that is safe, else along the plan that was published last."""
    stop = constraints.brake(state)
    if constraints.keeps(stop, state) or incumbent is None:
        return Proposal(stop, PlanSource.REST, reason)
    shifted = _shifted(constraints, state, incumbent)
    return Proposal(shifted, PlanSource.SHIFTED, reason) if shifted else _brake(constraints, state, reason)


def _shifted(constraints: PlanningConstraints, state: FleetState, incumbent: Trajectory | None) -> Trajectory | None:
    """Return what is left of the plan published last, if that still holds."""
    if incumbent is None:
        return None
    shifted = incumbent.remainder(state.time, state.position, state.velocity)
    return shifted if constraints.keeps(shifted, state) else None


def _brake(constraints: PlanningConstraints, state: FleetState, reason: str) -> Proposal:
    return Proposal(constraints.brake(state), PlanSource.BRAKE, reason)
