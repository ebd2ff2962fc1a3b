"""The constraints of the next plan: who takes part, which bounds can be kept, what can be measured."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.passive_safety import braking_violation
from mpc_cover.control.constraint_relaxation import attainable_bounds, strict_bounds
from mpc_cover.control.obstacle_trajectories import path_among
from mpc_cover.control.reachability import reachable
from mpc_cover.model.braking import braking_trajectory
from mpc_cover.model.constraint_tightening import slowed, tightened, without_lost
from mpc_cover.model.fleet_constraints import FleetConstraints
from mpc_cover.planning.initial_guess.rendezvous import out_of_range
from mpc_cover.planning.scp import BRAKING_TOLERANCE
from mpc_cover.verification.path import Path

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory

_NOTICED = 2
"""Periods for which someone may fly on along the last plan when a message is lost: its reports tell within one."""
_LEAST_RANGE = 0.75
"""This part of the range is used at the least, however slow someone may be: the rest is better than nothing."""


class PlanningConstraints:
    """The bounds that plans of a flight are held to, step by step.

    Attributes
    ----------
    fleet : tightened by the tube and for whoever may be slow, without the lost, as fast as it really is.
    bounds : those that plans are held to; see `constraint_relaxation`.
    reachable : (J, K), what those who are left can measure.
    """

    def __init__(self, mission: Mission) -> None:
        self._given = mission
        self._tight = FleetConstraints.of(tightened(mission), reaction_periods=_reaction(mission))
        self._lost = np.zeros(mission.fleet.size, dtype=bool)
        self._share = np.ones(mission.fleet.size)
        self.fleet = self._wary(self._tight)
        self.bounds = strict_bounds(self.fleet)
        self.reachable: BoolArray = np.ones((mission.fleet.radius.shape[1], mission.field.size), dtype=bool)

    @property
    def planned(self) -> FleetConstraints:
        """The bounds that plans are to be made for."""
        return self.bounds.planned

    @property
    def horizon(self) -> int:
        """Samples of the horizon."""
        return self._given.spec.control.horizon_steps

    @property
    def range_infeasible(self) -> bool:
        """Whether not even the range can be kept from here."""
        return self.bounds.fleet.communication_range > self.fleet.communication_range

    def disconnected(self, state: FleetState) -> bool:
        """Return whether those who take part are out of range, or, after a loss, cannot stop before they are."""
        return out_of_range(state.position, self.fleet) or (self.range_infeasible and bool(state.lost.any()))

    def update(self, state: FleetState, incumbent: Trajectory | None) -> bool:
        """See who takes part, which bounds can be kept from here, and what is in reach; `incumbent` is flown so far.

        Returns whether the fleet is another than before: someone was lost, came back, or is slower than was thought.
        """
        changed = not (np.array_equal(state.lost, self._lost) and np.array_equal(state.speed_share, self._share))
        if changed:
            self._lost, self._share = state.lost.copy(), state.speed_share.copy()
            self.fleet = without_lost(slowed(self._wary(self._tight), self._share), self._lost)
            self.reachable = reachable(self.fleet, self._given.field.cell, state.position[self._lost])
        self.bounds = attainable_bounds(self.fleet, self._ways_out(state, incumbent), state.actual)
        return changed

    def _ways_out(self, state: FleetState, incumbent: Trajectory | None) -> list[Path]:
        """Return what can be flown whatever else is found: the rest of the plan flown so far, and the brake."""
        known = [] if incumbent is None else [incumbent.remainder(state.time, state.position, state.velocity)]
        return [path_among(motion, state) for motion in (*known, self.brake(state))]

    def brake(self, state: FleetState) -> Trajectory:
        """Return the motion that stops everyone as fast as they can."""
        control = self._given.spec.control
        return braking_trajectory(
            state.position, state.velocity, self.fleet, state.time, control.period_s, control.horizon_steps
        )

    def keeps(self, plan: Trajectory, state: FleetState) -> bool:
        """Return whether the verifier passes a plan from a state."""
        return self.bounds.keeps(path_among(plan, state), state.actual)

    def safe_if_missed(self, plan: Trajectory, known: Trajectory) -> bool:
        """Return whether all is well while anyone goes on along the plan that is known, until that is noticed."""
        last = min(_NOTICED, plan.steps, known.steps)
        new, old = (
            Path(one.time[: last + 1], one.position[: last + 1], one.velocity[: last + 1], one.input[:last])
            for one in (plan, known)
        )
        return self.bounds.keeps_mixed(new, old)

    def keeps_passive_safety(
        self, plan: Trajectory, known: Trajectory, before: tuple[FloatArray, FloatArray] | None
    ) -> bool:
        """Return whether a plan leaves as much room to stop as is wanted, or as the known one does.

        `before` is the state a period earlier: who stopped then is not known of yet.
        """
        new = self.braking_violation(plan, before)
        return new <= BRAKING_TOLERANCE or new <= self.braking_violation(known, before)

    def braking_violation(self, plan: Trajectory, before: tuple[FloatArray, FloatArray] | None = None) -> float:
        """Return by how much [m] someone comes too near to one who stops without warning, or that one leaves the box.

        `before` is as above.
        """
        position, velocity = plan.position, plan.velocity
        if before is not None:
            pairs = zip(before, (position, velocity), strict=True)
            position, velocity = (np.concatenate([first[None], later]) for first, later in pairs)
        return braking_violation(position, velocity, plan.period, self.bounds.planned)

    def _wary(self, fleet: FleetConstraints) -> FleetConstraints:
        """Return the fleet with range to spare for those who may yet turn out to be slow: they fall behind at first."""
        stated = [share for share in self._given.spec.disturbance.slow_agents.values() if share < 1.0]
        if len(stated) <= np.count_nonzero(self._share < 1.0):
            return fleet
        behind = (1.0 - min(stated)) * float(fleet.speed_max.max())
        unseen_s = fleet.reaction_periods * self._given.spec.control.period_s
        reach = fleet.communication_range
        return replace(fleet, communication_range=max(reach - behind * unseen_s, _LEAST_RANGE * reach))


def _reaction(mission: Mission) -> float:
    """Return how many periods may pass from a death until others fly a plan that knows of it.

    It brakes from its last report on. A tick sees that it is gone; the plan of that tick begins at the next.
    """
    control = mission.spec.control
    unheard_s = control.state_period_s + mission.spec.disturbance.delay_s
    return 2.0 + unheard_s / control.period_s if mission.fleet.size > 1 else 0.0
