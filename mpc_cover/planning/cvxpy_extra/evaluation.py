"""What a user's terms are worth on a motion, and by how much it violates the user's constraints.

Nothing of the planner is used: the user's function is called with the motion's own numbers, which is also the iterate,
so that a constraint linearised at the iterate is judged as it is meant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cvxpy as cp
import numpy as np

from mpc_cover.errors import UserError
from mpc_cover.planning.cvxpy_extra.extra import shown
from mpc_cover.planning.cvxpy_extra.motion_variables import MotionVariables
from mpc_cover.planning.cvxpy_extra.statuses import INFEASIBLE, UNBOUNDED, quiet

if TYPE_CHECKING:
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.cvxpy_extra.extra import Extra, Group, Parts

_TOLERANCE = 1e-4
"""Violation up to which a user's constraint holds, in the smallest sensing radius; a plain choice, above the 1e-5 that
first-order solvers leave (interior points 1e-8) and far below what matters."""
_ROUNDING = 16.0
"""Rounding errors of coordinates that are tolerated, in units of their last digit; a plain choice."""
_ASIDE = 1e4
"""Cost of a step away from the motion where a user's own variables are solved for, relative to their terms [1/m]; a
plain choice that makes the step 0 wherever the motion can be kept."""


@dataclass(frozen=True)
class Judged:
    """A group of constraints on a motion.

    Attributes
    ----------
    name : the group's.
    margin : the least slack, in the constraint's own unit; negative where it is violated, -inf where it has no value.
    holds : whether it does, within the tolerance.
    where : the constraint and the entry of the least slack.
    violation : the sum of all violations.
    """

    name: str
    margin: float
    holds: bool
    where: str
    violation: float


@dataclass(frozen=True)
class Evaluation:
    """A user's parts on a motion: the sum of the terms, how many there are, and each group of constraints."""

    value: float
    terms: int
    groups: tuple[Judged, ...]

    @property
    def holds(self) -> bool:
        """Whether all constraints hold."""
        return all(group.holds for group in self.groups)

    @property
    def violation(self) -> float:
        """The sum of the violations of all constraints."""
        return math.fsum(group.violation for group in self.groups)


def evaluate(extra: Extra, motion: Trajectory, mission: Mission) -> Evaluation:
    """Return the user's parts on a motion [m].

    Variables of the user's own take the values that are best for the terms while the motion stays what it is.

    Raises
    ------
    UserError
        As `Extra.parts`; a term has no finite value on the motion.
    """
    ids = mission.fleet.ids
    parts = extra.parts(MotionVariables.fixed(motion, ids), mission)
    texts = [[shown(constraint) for constraint in group.constraints] for group in parts.groups]
    if any(variable.value is None for variable in _variables(parts)):
        near, aside = MotionVariables.near(motion, ids)
        parts = extra.parts(near, mission)
        _solve_for_others(extra.name, parts, aside)
    tolerance, places = _tolerance(mission), _Places(motion, ids)
    with np.errstate(all="ignore"):  # outside of a logarithm's domain, for example: told below
        value = parts.total.value
        if value is None or not np.isfinite(value):
            which = next((n for n, one in enumerate(parts.terms) if not _finite(one)), 0)
            raise UserError(f"extra {extra.name}: terms[{which}] has no finite value on the motion: {value}")
        groups = tuple(_judged(group, said, places, tolerance) for group, said in zip(parts.groups, texts, strict=True))
    return Evaluation(float(value), len(parts.terms), groups)


def _variables(parts: Parts) -> list[Any]:
    return [variable for item in (*parts.terms, *parts.constraints) for variable in item.variables()]


def _solve_for_others(name: str, parts: Parts, aside: list[Any]) -> None:
    """Give the user's own variables their best values, and the motion its own again.

    Raises
    ------
    UserError
        There are none, for this motion or any other.
    """
    moved = sum(cp.sum(cp.abs(each)) for each in aside)
    problem = cp.Problem(cp.Minimize(parts.total + _ASIDE * moved), parts.constraints)
    with quiet():
        try:
            problem.solve(solver=cp.CLARABEL, canon_backend=cp.SCIPY_CANON_BACKEND)
        except cp.error.SolverError:
            return
    if problem.status in UNBOUNDED:
        raise UserError(f"extra {name}: its terms have no lower bound: CVXPY's status is {problem.status}")
    if problem.status in INFEASIBLE:
        raise UserError(f"extra {name}: its constraints leave no motion at all: CVXPY's status is {problem.status}")
    for each in aside:
        each.value = np.zeros(each.shape)


def _tolerance(mission: Mission) -> float:
    fleet = mission.fleet
    farthest = np.abs(np.concatenate([fleet.motion_min, fleet.motion_max])).max()
    return _TOLERANCE * fleet.sensing_radius_min + _ROUNDING * float(np.spacing(farthest))


def _judged(group: Group, texts: list[str], places: _Places, tolerance: float) -> Judged:
    if not group.constraints:
        return Judged(group.name, math.inf, holds=True, where="no constraint", violation=0.0)
    slacks = [_slack(constraint) for constraint in group.constraints]
    least = int(np.argmin([slack.min(initial=math.inf) for slack in slacks]))
    slack = slacks[least]
    where = places.of(slack)
    if "[[" not in texts[least]:  # which would be numbers
        where = f"{texts[least]}, {where}".removesuffix(", ")
    margin = float(slack.min(initial=math.inf))
    violation = math.fsum(float(np.maximum(-each, 0.0).sum()) for each in slacks)
    return Judged(group.name, margin, margin >= -tolerance, where, violation)


@dataclass(frozen=True)
class _Places:
    """Where the entries of a constraint are, where its shape tells: a sample, and an agent."""

    motion: Trajectory
    agent_id: tuple[str, ...]

    def of(self, slack: Any) -> str:
        """Return where the least of an array is."""
        if slack.ndim == 0 or slack.size == 0:
            return ""
        entry = [int(index) for index in np.unravel_index(int(np.argmin(slack)), slack.shape)]
        samples = self.motion.time.size
        if slack.shape[0] not in {samples, samples - 1}:
            return self.agent_id[entry[0]] if slack.shape == (len(self.agent_id),) else f"entry {entry}"
        time = f"t = {self.motion.time[entry[0]]:.3f} s"
        if slack.ndim > 1 and slack.shape[1] == len(self.agent_id):
            return f"{self.agent_id[entry[1]]}, {time}"
        return time


def _slack(constraint: Any) -> Any:
    """Return the slack of each entry of a constraint; of cones and equalities 0 at the most; -inf without a value."""
    if isinstance(constraint, cp.constraints.nonpos.Inequality):
        value = constraint.expr.value
        slack = None if value is None else -np.asarray(value, dtype=float)
    else:
        try:
            value = constraint.violation()
        except ValueError:  # CVXPY's way to say that a variable has no value
            value = None
        slack = None if value is None else -np.abs(np.asarray(value, dtype=float))
    if slack is None:
        return np.array(-math.inf)
    return np.where(np.isfinite(slack), slack, -math.inf) + 0.0  # no -0


def _finite(term: Any) -> bool:
    return term.value is not None and bool(np.isfinite(term.value).all())
