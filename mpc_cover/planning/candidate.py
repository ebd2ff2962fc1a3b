"""Candidate plans, their evaluation, and the order in which they are preferred."""

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
    """A plan and its evaluation.

    Attributes
    ----------
    plan : the motion.
    cost : its J (4.34) [m].
    feasible : whether it satisfies all requirements.
    origin : of its initial guess.
    refined : the SCP result behind it.
    braking_violation : largest violation of passive safety [m].
    main : the plan without its extension to what it leaves; None where it has none.
    """

    plan: Trajectory
    cost: float
    feasible: bool
    origin: Origin
    refined: SCPResult | None = None
    braking_violation: float = 0.0
    main: Trajectory | None = None

    @property
    def kind(self) -> GuessKind:
        """The kind of its initial guess."""
        return self.origin.kind

    @property
    def idle(self) -> bool:
        """Whether it rests although demand is outstanding."""
        return self.kind is GuessKind.REST and self.cost > 0.0

    @property
    def violates_passive_safety(self) -> bool:
        """Whether it violates passive safety by more than the tolerance."""
        return self.braking_violation > BRAKING_TOLERANCE

    @property
    def covers(self) -> bool:
        """Whether it is feasible and covers the whole demand."""
        return self.feasible and self.cost == 0.0

    @property
    def complete(self) -> bool:
        """Whether it is feasible, covers the whole demand, and is passively safe."""
        return self.covers and not self.violates_passive_safety

    @property
    def rank(self) -> tuple[bool, bool, bool, int, float]:
        """Sort key: feasibility, full coverage, passive safety, length; without full coverage feasibility and merit."""
        last = (self.violates_passive_safety, self.plan.steps) if self.covers else (False, 0)
        return not self.feasible, self.cost > 0.0, *last, merit(self.cost, self.braking_violation)


def candidate_of(task: Task, steps: int, refined: SCPResult, origin: Origin) -> Candidate:
    """Return the candidate of an SCP result of so many `steps`."""
    position, velocity = task.ocp(steps).motion(refined.x)
    plan = Trajectory.even(task.start_time, task.period, position, velocity, np.diff(velocity, axis=0) / task.period)
    return Candidate(plan, refined.cost, refined.feasible, origin, refined, refined.braking_violation)


def evaluate_guess(task: Task, guess: Guess, steps: int | None = None) -> Candidate:
    """Return the candidate of an initial guess without refinement, in so many `steps` or as many as it takes."""
    motion = task.flown(guess, steps)
    ocp = task.ocp(motion.steps)
    return candidate_of(task, motion.steps, evaluate(ocp, ocp.decision_of(motion)), guess.origin)


def evaluate_motion(task: Task, position: FloatArray, velocity: FloatArray, origin: Origin) -> Candidate:
    """Return the candidate of velocities (N+1, m, d) [m/s] from a (m, d) `position` [m], without refinement."""
    ocp = task.ocp(velocity.shape[0] - 1)
    return candidate_of(task, ocp.steps, evaluate(ocp, ocp.decision(position, velocity)), origin)


def guess_priority(candidate: Candidate, violation_cost: float) -> float:
    """Return a sort key of guesses: length [s], increased by `violation_cost` [1/m] times the violation, plus J [m]."""
    plan = candidate.plan
    violation = candidate.refined.violation if candidate.refined is not None else 0.0
    return plan.steps * plan.period * (1.0 + violation_cost * violation) + candidate.cost
