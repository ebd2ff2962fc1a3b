"""Fallback when there is no new plan: the incumbent plan, shifted; if that violates the bounds, braking to rest."""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING

from mpc_cover.control.control_law import PlanSource, Proposal
from mpc_cover.control.horizon import ended_at_rest

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.control.planning_constraints import PlanningConstraints
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory


_HORIZONS = (1, 2, 3)
"""Lengths of proposals that are tried, in horizons; a plain choice. Lost agents are waited for as long."""
_TRIED = 5
"""Beginnings that are tried for each further horizon; a plain choice, as neighbours mostly fail alike."""


def best_proposal(
    constraints: PlanningConstraints,
    state: FleetState,
    plan: Trajectory | None,
    incumbent: Trajectory | None,
    reason: str,
) -> Proposal:
    """Return the horizon of the mission plan, ended at rest and verified; else the shifted incumbent, or braking.

    With weak inputs straight braking takes most of a horizon and may end at a wall wherever it begins in it: then a
    longer beginning of the plan is proposed, up to all of it, which ends at rest and is verified as a whole.
    """
    if plan is not None:
        for horizons in _HORIZONS:
            horizon = horizons * constraints.horizon
            every = 1 if horizons == 1 else max(1, constraints.horizon // _TRIED)
            beginnings = islice(ended_at_rest(plan, constraints.planned, horizon), 0, None, every)
            if (proposal := _first_safe(constraints, state, list(beginnings), incumbent, reason)) is not None:
                return proposal
            if plan.steps <= horizon:
                break
    reason = "no new plan passed the verifier"
    shifted = _shifted(constraints, state, incumbent)
    return Proposal(shifted, PlanSource.SHIFTED, reason) if shifted else _brake(constraints, state, reason)


def _first_safe(
    constraints: PlanningConstraints,
    state: FleetState,
    beginnings: Sequence[Trajectory],
    incumbent: Trajectory | None,
    reason: str,
) -> Proposal | None:
    """Return the first beginning of a plan that is verified and keeps away from all that other agents may hold.

    Where not even the shortest does, the fleet is too tight for that: then the longest that is verified, eased; None
    where reports are missing, too.
    """
    kept = (one for one in beginnings if constraints.keeps(one, state))
    longest = next(kept, None)
    if longest is None:
        return None
    if constraints.apart_from_held(longest, state, incumbent):
        return Proposal(longest, PlanSource.NEW, reason)
    if constraints.apart_from_held(beginnings[-1], state, incumbent):
        for shorter in kept:
            if constraints.apart_from_held(shorter, state, incumbent):
                return Proposal(shorter, PlanSource.NEW, reason)
    eased = constraints.apart_from_held(longest, state, incumbent, eased=True)
    return Proposal(longest, PlanSource.NEW, reason, eased=True) if eased else None


def stop_proposal(
    constraints: PlanningConstraints, state: FleetState, incumbent: Trajectory | None, reason: str
) -> Proposal:
    """Return a proposal that comes to rest: at once if that is safe, else as soon as it is along the incumbent plan."""
    for number, motion in enumerate(constraints.stopping_motions(state, incumbent)):
        safe = constraints.keeps(motion, state) and constraints.apart_from_held(motion, state, incumbent)
        if safe or incumbent is None:
            return Proposal(motion, PlanSource.SHIFTED if number else PlanSource.REST, reason)
    return _brake(constraints, state, reason)


def _shifted(constraints: PlanningConstraints, state: FleetState, incumbent: Trajectory | None) -> Trajectory | None:
    """Return the shifted incumbent, or None if there is none or it violates the bounds."""
    if incumbent is None:
        return None
    shifted = incumbent.remainder(state.time, state.position, state.velocity)
    return shifted if constraints.keeps(shifted, state) else None


def _brake(constraints: PlanningConstraints, state: FleetState, reason: str) -> Proposal:
    return Proposal(constraints.brake(state), PlanSource.BRAKE, reason)
