"""The constraints of the next plan: active agents, attainable bounds, and what can be measured."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.passive_safety import braking_violation
from mpc_cover.control.constraint_relaxation import attainable_bounds, strict_bounds
from mpc_cover.control.held_plans import crossing
from mpc_cover.control.obstacle_trajectories import path_among
from mpc_cover.control.reachability import reachable
from mpc_cover.control.stopping import stopping_motions
from mpc_cover.model.braking import braking_trajectory
from mpc_cover.model.constraint_tightening import slowed, tightened, without_lost
from mpc_cover.model.fleet_constraints import FleetConstraints
from mpc_cover.model.look_instants import looks_in_flight, measures_on_the_way
from mpc_cover.model.motion import chord_deviation
from mpc_cover.planning.initial_guess.rendezvous import out_of_range
from mpc_cover.planning.scp import BRAKING_TOLERANCE
from mpc_cover.verification.path import Path

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory

_MISSED_PERIODS = 2
"""Periods for which an agent may stay on the last plan after a lost message: its reports reveal it within one, and the
plan of that step begins at the next."""
_REACTION_PERIODS = 2.0
"""Periods from the report in which an agent is missing to the first plan that accounts for it: the step that notices,
and the one at whose end its plan begins."""
_RANGE_SHARE_MIN = 0.75
"""Least part of the communication range that plans use, however slow an agent may be; a plain choice."""


class PlanningConstraints:
    """The bounds of plans, updated at each step.

    Attributes
    ----------
    fleet : tightened by the tube and for agents that may be slow, without lost agents, with the speeds observed.
    bounds : the bounds of plans, relaxed where the state requires it; see `constraint_relaxation`.
    reachable : (J, K), what the active agents can measure.
    """

    def __init__(self, mission: Mission) -> None:
        self._given = mission
        instants = looks_in_flight(mission, mission.spec.control.period_s)
        fleet = replace(tightened(mission), radius=_planned_radius(mission))
        self._tight = FleetConstraints.of(fleet, reaction_periods=_reaction(mission), look_instants=instants)
        self._lost = np.zeros(mission.fleet.size, dtype=bool)
        self._share = np.ones(mission.fleet.size)
        self.fleet = self._with_range_reserve(self._tight)
        self.bounds = strict_bounds(self.fleet)
        self.reachable: BoolArray = np.ones((mission.fleet.radius.shape[1], mission.field.size), dtype=bool)

    @property
    def planned(self) -> FleetConstraints:
        """The constraints to plan with."""
        return self.bounds.planned

    def in_steps(self, fleet: FleetConstraints) -> FleetConstraints:
        """Return the same constraints for plans whose samples are a step of plans apart instead of a period."""
        control = self._given.spec.control
        if control.substeps == 1:
            return fleet
        # reactions shorter than a step have no samples of their own: they count as a step
        reaction = max(fleet.reaction_periods / control.substeps, 1.0) if fleet.reaction_periods else 0.0
        instants = looks_in_flight(self._given, control.plan_step)
        return replace(fleet, reaction_periods=reaction, look_instants=instants)

    @property
    def horizon(self) -> int:
        """Length of the horizon [periods]."""
        return self._given.spec.control.horizon_periods

    @property
    def range_infeasible(self) -> bool:
        """Whether no known motion from the present state keeps the communication range."""
        return self.bounds.fleet.communication_range > self.fleet.communication_range

    def disconnected(self, state: FleetState) -> bool:
        """Return whether active agents are out of range, or, after a loss, cannot stop before they are."""
        return out_of_range(state.position, self.fleet) or (self.range_infeasible and bool(state.lost.any()))

    def update(self, state: FleetState, incumbent: Trajectory | None) -> bool:
        """Update active agents, attainable bounds and reachable cells; `incumbent` is the plan in force.

        Returns whether the fleet has changed: an agent was lost, came back, or has another speed limit.
        """
        changed = not (np.array_equal(state.lost, self._lost) and np.array_equal(state.speed_share, self._share))
        if changed:
            self._lost, self._share = state.lost.copy(), state.speed_share.copy()
            self.fleet = without_lost(slowed(self._with_range_reserve(self._tight), self._share), self._lost)
            self.reachable = reachable(self.fleet, self._given.field.cell, state.position[self._lost])
        self.bounds = attainable_bounds(self.fleet, self._fallbacks(state, incumbent), state.actual)
        return changed

    def _fallbacks(self, state: FleetState, incumbent: Trajectory | None) -> list[Path]:
        """Return the motions that are available in any case: the shifted incumbent, and braking."""
        known = [] if incumbent is None else [incumbent.remainder(state.time, state.position, state.velocity)]
        return [path_among(motion, state) for motion in (*known, self.brake(state))]

    def brake(self, state: FleetState) -> Trajectory:
        """Return the motion in which all agents brake at their input limits."""
        control = self._given.spec.control
        return braking_trajectory(
            state.position, state.velocity, self.fleet, state.time, control.period_s, control.horizon_periods
        )

    def stopping_motions(self, state: FleetState, incumbent: Trajectory | None) -> Iterator[Trajectory]:
        """Yield motions to rest, the earliest first: braking at once, then along the plan in force."""
        control = self._given.spec.control
        return stopping_motions(state, incumbent, self.fleet, control.period_s, control.horizon_periods)

    def keeps(self, plan: Trajectory, state: FleetState) -> bool:
        """Return whether the verifier accepts a plan from a state."""
        return self.bounds.keeps(path_among(plan, state), state.actual)

    def apart_from_held(
        self, plan: Trajectory, state: FleetState, incumbent: Trajectory | None, *, eased: bool = False
    ) -> bool:
        """Return whether a plan keeps away from all that other agents may fly, or as far as what is flown otherwise."""
        known = [] if incumbent is None else [incumbent.remainder(state.time, state.position, state.velocity)]
        return crossing(plan, state, self.bounds.planned, [*known, self.brake(state)], eased=eased) is None

    def safe_if_missed(self, plan: Trajectory, known: Trajectory) -> bool:
        """Return whether the bounds hold while any agent stays on the known plan, until the missed one is noticed."""
        last = min(_MISSED_PERIODS, plan.steps, known.steps)
        new, old = (
            Path(one.time[: last + 1], one.position[: last + 1], one.velocity[: last + 1], one.input[:last])
            for one in (plan, known)
        )
        return self.bounds.keeps_mixed(new, old)

    def keeps_passive_safety(
        self, plan: Trajectory, known: Trajectory, before: tuple[FloatArray, FloatArray] | None
    ) -> bool:
        """Return whether a plan is passively safe, or at least as safe as the known one.

        `before` is the state (m, d) [m], [m/s] a period earlier: agents that stopped then have not been noticed yet.
        """
        new = self.braking_violation(plan, before)
        return new <= BRAKING_TOLERANCE or new <= self.braking_violation(known, before)

    def braking_violation(self, plan: Trajectory, before: tuple[FloatArray, FloatArray] | None = None) -> float:
        """Return by how much [m] a plan violates passive safety: separation from braking agents, or the box.

        `before` is as in `keeps_passive_safety`.
        """
        position, velocity = plan.position, plan.velocity
        if before is not None:
            pairs = zip(before, (position, velocity), strict=True)
            position, velocity = (np.concatenate([first[None], later]) for first, later in pairs)
        return braking_violation(position, velocity, plan.period, self.bounds.planned)

    def _with_range_reserve(self, fleet: FleetConstraints) -> FleetConstraints:
        """Return the fleet with a reduced range while slow agents are not identified: until then they fall behind."""
        stated = [share for share in self._given.spec.disturbance.slow_agents.values() if share < 1.0]
        if len(stated) <= np.count_nonzero(self._share < 1.0):
            return fleet
        behind = (1.0 - min(stated)) * float(fleet.speed_max.max())
        unseen_s = fleet.reaction_periods * self._given.spec.control.period_s
        reach = fleet.communication_range
        return replace(fleet, communication_range=max(reach - behind * unseen_s, _RANGE_SHARE_MIN * reach))


def _planned_radius(mission: Mission) -> FloatArray:
    """Return the sensing radii (m, J) [m] of plans; of continuous sensing less than the tightened ones by two chords.

    The map marks what chords between reports pass, within the radius less what paths may leave them by.
    """
    radius = tightened(mission).radius
    if not measures_on_the_way(mission):
        return radius
    margin = 2.0 * chord_deviation(mission.fleet.input_max, mission.spec.control.state_period_s)[:, None]
    return np.asarray(np.where(radius > margin, radius - margin, radius))


def _reaction(mission: Mission) -> float:
    """Return the periods from the stop of an agent until the others follow a plan that accounts for it.

    The agent brakes from its last report on. A step notices that it is lost; the plan of that step begins at the next.
    """
    control = mission.spec.control
    unheard_s = control.state_period_s + mission.spec.disturbance.delay_s
    return _REACTION_PERIODS + unheard_s / control.period_s if mission.fleet.size > 1 else 0.0
