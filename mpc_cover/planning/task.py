"""What is to be planned: where something is owed, from where, and how the motion ends."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.constraints.boundary import BoundaryConditions
from mpc_cover.coverage.nearest import remaining_weight
from mpc_cover.model.sensing import look_counts
from mpc_cover.planning.initial_guess.waypoint_tracking import track_waypoints
from mpc_cover.planning.ocp import OCP

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.model.fleet_constraints import FleetConstraints
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.initial_guess.guess import Guess


class End(StrEnum):
    """How a motion ends (3.15)."""

    REST = "rest"
    """At rest anywhere."""
    FREE = "free"
    FIXED = "fixed"
    """At rest at a given place."""
    CLOSED = "closed"
    """In the state of the start."""


LOOKS_PER_LAP = 3
"""Looks at a cell that fast passes bring in one lap: with four agents planning takes twice as long for each more."""


def needs_laps(looks: IntArray | None) -> bool:
    """Return whether so many looks (J, K) are owed that plans which pass by as fast as they can need several laps."""
    return looks is not None and int(looks.max(initial=0)) > LOOKS_PER_LAP


def multi_look_options(looks: IntArray | None) -> dict[str, Any]:
    """Return how far a QP may move samples, and how many of them share a look: those of many looks are dense."""
    return {"region": 0.25, "count": 3} if needs_laps(looks) else {"region": 0.5}


@dataclass(frozen=True, eq=False)
class Task:
    """What is to be covered, and from where.

    Attributes
    ----------
    fleet : limits, radii, ranges.
    cell : (K, d) [m].
    weight : (J, K) gamma.
    position, velocity : (m, d) [m], [m/s].
    start_time : mission time of sample 0 [s].
    period : T_s [s].
    start_free : whether plans may start elsewhere; `position` is then a hint.
    end : how the motion ends.
    goal : (m, d) [m], for a fixed end.
    looks : (J, K) looks owed; None for one each.
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
        """The fewest steps in which whoever moves can stop."""
        speed = np.linalg.norm(self.velocity, axis=1)
        return int(np.ceil(float((speed / self.fleet.input_max).max()) / self.period)) + 2

    def ocp(self, steps: int) -> OCP:
        """Return the stretch of `steps` samples with the ends that are asked for."""
        ends = BoundaryConditions(
            start_position=None if self.start_free else self.position,
            start_velocity=None if self.start_free else self.velocity,
            end_position=self.goal if self.end is End.FIXED else None,
            end_velocity=np.zeros_like(self.velocity) if self.end in {End.REST, End.FIXED} else None,
            closed=self.end is End.CLOSED,
        )
        return OCP(self.fleet, self.cell, self.weight, steps, self.period, ends, self.looks, self.on_iterate)

    def remaining_after(self, plan: Trajectory) -> FloatArray:
        """Return the weights (J, K) of what a plan's samples leave over; of several looks owed, all are to be taken."""
        if self.looks is not None:
            enough = look_counts(plan.position, self.cell, self.fleet.radius) >= self.looks
            return np.where(enough, 0.0, self.weight)
        return remaining_weight(plan.position, self.cell, self.fleet.radius, self.weight)

    def flown(self, guess: Guess, steps: int | None) -> Trajectory:
        """Fly a guess from the start, or from where it begins if that is free, to the end that is asked for.

        In so many `steps`, or as many as it takes. A guess that is a motion keeps its own timing.
        """
        if guess.motion is not None:
            return guess.motion
        position, paths = self.position, guess.paths
        if self.start_free:
            position = np.array([path[0] for path in paths])
        if self.end in {End.FIXED, End.CLOSED}:
            home = position if self.goal is None else self.goal
            paths = [np.concatenate([path, goal[None]]) for path, goal in zip(paths, home, strict=True)]
        stop = self.end is not End.FREE
        return track_waypoints(
            paths,
            position,
            self.velocity,
            self.fleet,
            self.period,
            start_time=self.start_time,
            steps=steps,
            stop=stop,
        )
