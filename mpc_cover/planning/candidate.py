"""Candidates: plans with what they are worth, and in which order they are preferred."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.initial_guess.guess import GuessKind
from mpc_cover.planning.scp import BRAKING_TOLERANCE, evaluate, merit

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.planning.initial_guess.guess import Guess, Origin
    from mpc_cover.planning.scp import SCPResult
    from mpc_cover.planning.task import Task


@dataclass(frozen=True, eq=False)
class Candidate:
    """A plan with what it is worth.

    Attributes
    ----------
    plan : the motion.
    cost : its J (4.34) [m].
    feasible : whether it keeps all requirements.
    origin : the guess that it grew from.
    refined : how it was refined, None for a guess as it flies.
    braking_violation : by how much someone comes too near to one who stops without warning [m].
    """

    plan: Trajectory
    cost: float
    feasible: bool
    origin: Origin
    refined: SCPResult | None = None
    braking_violation: float = 0.0

    @property
    def kind(self) -> GuessKind:
        """The kind of guess that it grew from."""
        return self.origin.kind

    @property
    def idle(self) -> bool:
        """Whether it stays, though something is owed."""
        return self.kind is GuessKind.REST and self.cost > 0.0

    @property
    def violates_passive_safety(self) -> bool:
        """Whether someone has no room to stop for one who stops without warning."""
        return self.braking_violation > BRAKING_TOLERANCE

    @property
    def covers(self) -> bool:
        """Whether everything is covered, feasibly."""
        return self.feasible and self.cost == 0.0

    @property
    def complete(self) -> bool:
        """Whether everything is covered, feasibly, and with room to stop."""
        return self.covers and not self.violates_passive_safety

    @property
    def rank(self) -> tuple[bool, bool, bool, int, float]:
        """Feasible before covering all before room to stop before short; what leaves something, by what it leaves."""
        last = (self.violates_passive_safety, self.plan.steps) if self.covers else (False, 0)
        return not self.feasible, self.cost > 0.0, *last, merit(self.cost, self.braking_violation)


def candidate_of(task: Task, steps: int, refined: SCPResult, origin: Origin) -> Candidate:
    """Return the candidate of a refined decision vector."""
    position, velocity = task.ocp(steps).motion(refined.x)
    plan = Trajectory.even(task.start_time, task.period, position, velocity, np.diff(velocity, axis=0) / task.period)
    return Candidate(plan, refined.cost, refined.feasible, origin, refined, refined.braking_violation)


def evaluate_guess(task: Task, guess: Guess, steps: int | None = None) -> Candidate:
    """Return the candidate of a guess as it flies, in so many steps or as many as it takes."""
    motion = task.flown(guess, steps)
    ocp = task.ocp(motion.steps)
    return candidate_of(task, motion.steps, evaluate(ocp, ocp.decision_of(motion)), guess.origin)


def evaluate_motion(task: Task, position: FloatArray, velocity: FloatArray, origin: Origin) -> Candidate:
    """Return the candidate of velocities (N+1, m, d) [m/s] from a (m, d) `position` [m], as they stand."""
    ocp = task.ocp(velocity.shape[0] - 1)
    return candidate_of(task, ocp.steps, evaluate(ocp, ocp.decision(position, velocity)), origin)


def guess_priority(candidate: Candidate, repair: float) -> float:
    """Order guesses as they fly: what they take [s], longer by `repair` for each metre of violation, and leave."""
    plan = candidate.plan
    violation = candidate.refined.violation if candidate.refined is not None else 0.0
    return plan.steps * plan.period * (1.0 + repair * violation) + candidate.cost
