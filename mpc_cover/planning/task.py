"""A planning task: the demand, the initial state and the terminal condition, for plans of any length."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.constraints.boundary import BoundaryConditions
from mpc_cover.coverage.nearest import remaining_weight
from mpc_cover.model.look_instants import inter_sample
from mpc_cover.model.sensing import look_counts
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.initial_guess.joint_polyline import cut_short
from mpc_cover.planning.initial_guess.waypoint_tracking import track_waypoints
from mpc_cover.planning.ocp import OCP
from mpc_cover.planning.scp import REFINEMENT_REGION

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.model.fleet_constraints import FleetConstraints
    from mpc_cover.planning.initial_guess.guess import Guess


class End(StrEnum):
    """The terminal condition of a motion (3.15)."""

    REST = "rest"
    """At rest at any position."""
    FREE = "free"
    """In any state."""
    FIXED = "fixed"
    """At rest at a given position."""
    CLOSED = "closed"
    """In the initial state."""


_STEPS_MARGIN = 2
"""Steps beyond those that braking takes, so that a plan has a choice; a plain choice."""
LOOKS_PER_LAP = 3
"""Looks at a cell that plans at full speed are required to take in one lap. With four agents each further look doubles
the planning time, as observed."""
_MANY_LOOKS_REGION, _MANY_LOOKS_SAMPLES = 0.25, 3
"""First trust radius in sensing radii, and samples per soft minimum, of QPs for many looks, which are dense. Plain
choices."""


def needs_laps(looks: IntArray | None) -> bool:
    """Return whether so many looks (J, K) are outstanding that plans at full speed need several laps."""
    return looks is not None and int(looks.max(initial=0)) > LOOKS_PER_LAP


def multi_look_options(looks: IntArray | None) -> dict[str, Any]:
    """Return the options of `scp.optimise` that refinements with these looks (J, K) use."""
    if needs_laps(looks):
        return {"region": _MANY_LOOKS_REGION, "count": _MANY_LOOKS_SAMPLES}
    return {"region": REFINEMENT_REGION}


@dataclass(frozen=True, eq=False)
class Task:
    """The demand to cover, from an initial state to a terminal condition.

    Attributes
    ----------
    fleet : limits, sensing radii, ranges.
    cell : (K, d) [m].
    weight : (J, K) gamma of the demand, 0 where there is none.
    position, velocity : (m, d) [m], [m/s].
    start_time : mission time of sample 0 [s].
    period : T_s [s].
    start_free : whether the initial state is free; `position` is then a hint.
    end : the terminal condition.
    goal : (m, d) [m], for a fixed end.
    looks : (J, K) demanded looks; None for one each.
    on_iterate : see `OCP`.
    """

    fleet: FleetConstraints
    cell: FloatArray
    weight: FloatArray
    position: FloatArray
    velocity: FloatArray
    start_time: float
    period: float
    start_free: bool = False
    end: End = End.REST
    goal: FloatArray | None = None
    looks: IntArray | None = None
    on_iterate: Callable[[FloatArray], None] | None = None

    @property
    def least_steps(self) -> int:
        """The fewest steps in which all agents can stop, with a margin."""
        speed = np.linalg.norm(self.velocity, axis=1)
        return int(np.ceil(float((speed / self.fleet.input_max).max()) / self.period)) + _STEPS_MARGIN

    def ocp(self, steps: int) -> OCP:
        """Return the OCP of so many steps with the boundary conditions of the task."""
        ends = BoundaryConditions(
            start_position=None if self.start_free else self.position,
            start_velocity=None if self.start_free else self.velocity,
            end_position=self.goal if self.end is End.FIXED else None,
            end_velocity=np.zeros_like(self.velocity) if self.end in {End.REST, End.FIXED} else None,
            closed=self.end is End.CLOSED,
        )
        return OCP(self.fleet, self.cell, self.weight, steps, self.period, ends, self.looks, self.on_iterate)

    def remaining_after(self, plan: Trajectory) -> FloatArray:
        """Return the weights (J, K) that remain after a plan; of several demanded looks, all must be taken."""
        if self.looks is not None:
            sufficient = look_counts(plan.position, self.cell, self.fleet.radius) >= self.looks
            return np.where(sufficient, 0.0, self.weight)
        between = inter_sample(plan, self.fleet.look_instants)
        return remaining_weight(plan.position, self.cell, self.fleet.radius, self.weight, between)

    def flown(self, guess: Guess, steps: int | None) -> Trajectory:
        """Return the motion of a guess from the initial state, or from its first waypoints if that is free.

        It satisfies the terminal condition, in so many `steps`, or as many as it takes. A guess that is a motion is
        flown as it is, as far as the steps allow, and braked together.
        """
        if guess.motion is not None:
            return guess.motion if steps in {None, guess.motion.steps} else self._cut_short(guess.motion, steps)
        position, paths = self.position, guess.paths
        if self.start_free:
            position = np.array([path[0] for path in paths])
        if self.end in {End.FIXED, End.CLOSED}:
            home = position if self.goal is None else self.goal
            paths = [np.concatenate([path, goal[None]]) for path, goal in zip(paths, home, strict=True)]
        stop = self.end is not End.FREE
        fleet = self.fleet
        if guess.cruise is not None:
            fleet = replace(fleet, speed_max=np.minimum(fleet.speed_max, guess.cruise))
        return track_waypoints(
            paths,
            position,
            self.velocity,
            fleet,
            self.period,
            start_time=self.start_time,
            steps=steps,
            stop=stop,
        )

    def _cut_short(self, motion: Trajectory, steps: int | None) -> Trajectory:
        """Return a motion in `steps` steps, to rest."""
        assert steps is not None
        velocity = cut_short(motion.velocity, steps, self.fleet.input_max, self.period)
        start = motion.position[0], velocity[0]
        return Trajectory.from_velocities(*start, velocity[1:], motion.start_time, self.period)
