"""What is to be planned, and what a plan is worth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from mpc_cover.constraints.boundary import Ends
from mpc_cover.coverage.nearest import still_owed
from mpc_cover.model.sensing import look_counts
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.initial_guess.waypoint_tracking import track_waypoints
from mpc_cover.planning.ocp import OCP
from mpc_cover.planning.scp import BRAKING_TOLERANCE, evaluate, merit

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.planning.initial_guess.boustrophedon import Guess
    from mpc_cover.planning.scp import SCPResult


AT_ONCE = 3
"""Looks at a cell that fast passes bring in one lap: with four agents planning takes twice as long for each more."""


def needs_laps(looks: IntArray | None) -> bool:
    """Return whether so many looks (J, K) are owed that plans which pass by as fast as they can need several laps."""
    return looks is not None and int(looks.max(initial=0)) > AT_ONCE


def gentle(looks: IntArray | None) -> dict[str, Any]:
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
    end : at "rest" anywhere, "free", "fixed" (at rest at `goal`), or "closed" (in the state of the start).
    goal : (m, d) [m], for a fixed end.
    looks : (J, K) looks owed; None for one each.
    on_iterate : see `OCP`.
    """

    fleet: Fleet
    cell: FloatArray
    weight: FloatArray
    position: FloatArray
    velocity: FloatArray
    start_time: float
    period: float
    start_free: bool = False
    end: Literal["rest", "free", "fixed", "closed"] = "rest"
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
        ends = Ends(
            start_position=None if self.start_free else self.position,
            start_velocity=None if self.start_free else self.velocity,
            end_position=self.goal if self.end == "fixed" else None,
            end_velocity=np.zeros_like(self.velocity) if self.end in {"rest", "fixed"} else None,
            closed=self.end == "closed",
        )
        return OCP(self.fleet, self.cell, self.weight, steps, self.period, ends, self.looks, self.on_iterate)

    def owed_after(self, plan: Trajectory) -> FloatArray:
        """Return the weights (J, K) of what a plan's samples leave over; of several looks owed, all are to be taken."""
        if self.looks is not None:
            enough = look_counts(plan.position, self.cell, self.fleet.radius) >= self.looks
            return np.where(enough, 0.0, self.weight)
        return still_owed(plan.position, self.cell, self.fleet.radius, self.weight)

    def flown(self, guess: Guess, steps: int | None) -> Trajectory:
        """Fly a guess from the start, or from where it begins if that is free, to the end that is asked for."""
        position, paths = self.position, guess.paths
        if self.start_free:
            position = np.array([path[0] for path in paths])
        if self.end in {"fixed", "closed"}:
            home = position if self.goal is None else self.goal
            paths = [np.concatenate([path, goal[None]]) for path, goal in zip(paths, home, strict=True)]
        stop = self.end != "free"
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


@dataclass(frozen=True, eq=False)
class Candidate:
    """A plan with what it is worth.

    Attributes
    ----------
    plan : the motion.
    cost : its J (4.34) [m].
    feasible : whether it keeps all requirements.
    kind : the guess that it grew from.
    refined : how it was refined, None for a guess as it flies.
    braking_violation : by how much someone comes too near to one who stops without warning [m].
    """

    plan: Trajectory
    cost: float
    feasible: bool
    kind: str
    refined: SCPResult | None = None
    braking_violation: float = 0.0

    @property
    def exposed(self) -> bool:
        """Whether someone has no room to stop for one who stops without warning."""
        return self.braking_violation > BRAKING_TOLERANCE

    @property
    def covers(self) -> bool:
        """Whether everything is covered, feasibly."""
        return self.feasible and self.cost == 0.0

    @property
    def complete(self) -> bool:
        """Whether everything is covered, feasibly, and with room to stop."""
        return self.covers and not self.exposed

    @property
    def rank(self) -> tuple[bool, bool, bool, int, float]:
        """Feasible before covering all before room to stop before short; what leaves something, by what it leaves."""
        last = (self.exposed, self.plan.steps) if self.covers else (False, 0)
        return not self.feasible, self.cost > 0.0, *last, merit(self.cost, self.braking_violation)


def candidate_of(task: Task, steps: int, refined: SCPResult, kind: str) -> Candidate:
    """Return the candidate of a refined decision vector."""
    position, velocity = task.ocp(steps).motion(refined.x)
    plan = Trajectory.even(task.start_time, task.period, position, velocity, np.diff(velocity, axis=0) / task.period)
    return Candidate(plan, refined.cost, refined.feasible, kind, refined, refined.braking_violation)


def as_flown(task: Task, guess: Guess, motion: Trajectory) -> Candidate:
    """Return the candidate of a guess as it flies."""
    ocp = task.ocp(motion.steps)
    return candidate_of(task, motion.steps, evaluate(ocp, ocp.decision_of(motion)), guess.kind)


def as_moved(task: Task, position: FloatArray, velocity: FloatArray, kind: str) -> Candidate:
    """Return the candidate of velocities (N+1, m, d) [m/s] from a (m, d) `position` [m], as they stand."""
    ocp = task.ocp(velocity.shape[0] - 1)
    return candidate_of(task, ocp.steps, evaluate(ocp, ocp.decision(position, velocity)), kind)


def promise(candidate: Candidate, repair: float) -> float:
    """Order guesses as they fly: what they take [s], longer by `repair` for each metre of violation, and leave."""
    plan = candidate.plan
    violation = candidate.refined.violation if candidate.refined is not None else 0.0
    return plan.steps * plan.period * (1.0 + repair * violation) + candidate.cost
