"""The static boustrophedon partition: each agent sweeps a strip of its own and ignores the others.

Before the start the cells are cut into strips, one per agent, with cells in proportion to speed, and assigned in the
order of the agents' positions, along the axis on which the slowest agent is done first. Each agent flies to and fro
through its strip, lane by lane, as fast as waypoint tracking allows within its limits; then it visits the cells left
over in its strip, the nearest first.

It ignores separation and connectivity: strips do not overlap, but the ways to them may cross, and a fleet spread over
strips may lose connectivity. So it is flown on the mission `without_coordination`, as otherwise none of its plans
would be sent, and judged by the whole mission like all controllers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.control.control_law import PlanSource, Proposal
from mpc_cover.control.recovery import Mode
from mpc_cover.mission.load import build_mission
from mpc_cover.model.braking import braking_trajectory
from mpc_cover.model.constraint_tightening import tightened
from mpc_cover.planning.initial_guess.lanes import cut_lanes, snake, swath_of
from mpc_cover.planning.initial_guess.waypoint_tracking import track_waypoints

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.information.demand import DemandMap
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.budget import Budget


def without_coordination(mission: Mission) -> Mission:
    """Return the mission for a law that respects neither separation, nor connectivity, nor links."""
    raw = mission.spec.model_dump(by_alias=True, exclude_none=True)
    for bound in ("communication_range_m", "separation_min_m", "links"):
        raw["fleet"].pop(bound, None)
    for bound in ("repel_within_m", "attract_beyond_m"):
        raw["potential"].pop(bound, None)
    return build_mission(raw, f"mission {mission.spec.name} without coordination")


@dataclass(frozen=True, eq=False)
class Strip:
    """One agent's share.

    Attributes
    ----------
    path : (W, d) waypoints through its lanes [m].
    own : (J, K) the magnitudes and cells assigned to it.
    """

    path: FloatArray
    own: BoolArray


class SweepLaw:
    """The partition as a control law; deterministic. It does not tolerate losses.

    Parameters
    ----------
    mission : the mission to fly.

    Attributes
    ----------
    strips : each agent's share; none before the first step of a fleet at rest.
    """

    tolerates_losses = False
    mode = Mode.NOMINAL

    def __init__(self, mission: Mission) -> None:
        self._period = mission.spec.control.period_s
        fleet = self._fleet = self._able = _off_the_walls(tightened(mission), self._period)
        self._cell = np.clip(mission.field.cell, fleet.motion_min, fleet.motion_max)
        self._capture = 0.5 * fleet.speed_max**2 / fleet.input_max
        braking = np.ceil((fleet.speed_max / (fleet.input_max * self._period)).max())
        self._steps = 2 * int(braking) + 2
        self.strips: list[Strip] = []
        self._passed: IntArray = np.zeros(fleet.size, dtype=np.intp)

    def step(self, state: FleetState, coverage: DemandMap, budget: Budget) -> Proposal:  # noqa: ARG002 - it takes no time
        """Return the plan towards all agents' next waypoints; a fleet at rest is first assigned what is owed."""
        self._fleet = replace(self._able, speed_max=self._able.speed_max * state.speed_share)
        if state.settled:
            self._share_out(state, coverage.owed)
        if coverage.complete:
            stop = braking_trajectory(
                state.position, state.velocity, self._fleet, state.time, self._period, self._steps
            )
            return Proposal(stop, PlanSource.REST, "all is covered")
        paths = [self._ahead(agent, state, coverage.owed) for agent in range(len(state.position))]
        motion = track_waypoints(paths, state.position, state.velocity, self._fleet, self._period, steps=self._steps)
        return Proposal(state.trajectory(motion.velocity[1:], self._period), PlanSource.NEW, "sweeps")

    def published(self, trajectory: Trajectory) -> None:
        """Do nothing: each step plans from the current state."""

    def _share_out(self, state: FleetState, owed: BoolArray) -> None:
        shares = [self._cut(state.position, owed, axis) for axis in range(state.position.shape[1])]
        self.strips = min(shares, key=lambda strips: self._flight(strips, state.position, state.velocity))
        self._passed = np.zeros(len(state.position), dtype=np.intp)

    def _ahead(self, agent: int, state: FleetState, owed: BoolArray) -> FloatArray:
        """Return an agent's waypoints: the rest of its lanes, else its nearest owed cell, else where it can stop."""
        strip, here, velocity = self.strips[agent], state.position[agent], state.velocity[agent]
        while self._passed[agent] < len(strip.path):
            path = strip.path[self._passed[agent] :]
            if np.linalg.norm(path[0] - here) >= self._capture[agent]:
                return path
            self._passed[agent] += 1
        left = self._cell[(strip.own & owed).any(axis=0)]
        if len(left):
            return left[[int(np.argmin(np.linalg.norm(left - here, axis=1)))]]
        braking = 0.5 * np.linalg.norm(velocity) / self._fleet.input_max[agent]
        return np.asarray((here + braking * velocity)[None])

    def _flight(self, strips: list[Strip], position: FloatArray, velocity: FloatArray) -> int:
        """Return how many steps it takes all agents to fly their lanes."""
        paths = [strip.path for strip in strips]
        return track_waypoints(paths, position, velocity, self._fleet, self._period).steps

    def _cut(self, position: FloatArray, owed: BoolArray, axis: int) -> list[Strip]:
        """Return a strip along `axis` for each agent; agents that measure the same magnitudes share their cells."""
        able = np.isfinite(self._fleet.radius)
        strips = [Strip(here[None], np.zeros_like(owed)) for here in position]
        for pattern in np.unique(able, axis=0):
            team = np.flatnonzero((able == pattern).all(axis=1))
            theirs = owed & pattern[:, None]
            for agent, cells in self._split(team, position, np.flatnonzero(theirs.any(axis=0)), axis):
                own = np.zeros_like(owed)
                own[:, cells] = theirs[:, cells]
                strips[agent] = Strip(self._lanes(agent, position[agent], cells, axis), own)
        return strips

    def _split(self, team: IntArray, position: FloatArray, cells: IntArray, axis: int) -> list[tuple[int, IntArray]]:
        """Cut cells into strips side by side, one for each of a team, as many cells as its share of the speed."""
        across = (axis + 1) % position.shape[1]
        ordered = cells[np.argsort(self._cell[cells, across], kind="stable")]
        agents = team[np.argsort(position[team, across], kind="stable")]
        speed = self._fleet.speed_max[agents]
        edges = np.round(np.cumsum(speed) / speed.sum() * len(ordered)).astype(int)
        return [(int(a), part) for a, part in zip(agents, np.split(ordered, edges[:-1]), strict=True) if len(part)]

    def _lanes(self, agent: int, here: FloatArray, cells: IntArray, axis: int) -> FloatArray:
        fleet = self._fleet
        radius = fleet.radius[agent]
        swath = swath_of(float(radius[np.isfinite(radius)].min()), float(fleet.speed_max[agent]), self._period)
        path = snake(cut_lanes(self._cell[cells], swath, axis), here)
        return np.asarray(np.clip(path, fleet.motion_min, fleet.motion_max))


def _off_the_walls(fleet: Fleet, period: float) -> Fleet:
    """Return the fleet in a box tightened by the overshoot of paths between two samples, u_max T_s^2 / 8."""
    size = fleet.motion_max - fleet.motion_min
    inset = np.minimum(float(fleet.input_max.max()) * period**2 / 8.0, 0.25 * size)
    return replace(fleet, motion_min=fleet.motion_min + inset, motion_max=fleet.motion_max - inset)
