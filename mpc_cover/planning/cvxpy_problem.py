"""The OCP of a mission with a user's terms and constraints: its subproblems in CVXPY, and what motions are worth.

What is a user's stays as it is in each subproblem of `planning.cvxpy_reference`: constraints are hard, terms are added
to the cost. Users write in metres; subproblems are in local units: terms are divided by the local unit, as J is.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import cvxpy as cp
import numpy as np

from mpc_cover.errors import UserError
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.coverage_nlp import CoverageNLP
from mpc_cover.planning.cvxpy_extra.evaluation import Evaluation, evaluate
from mpc_cover.planning.cvxpy_extra.motion_variables import MotionVariables
from mpc_cover.planning.cvxpy_extra.statuses import USABLE, quiet
from mpc_cover.planning.cvxpy_reference import build_cvxpy_motion, build_cvxpy_subproblem
from mpc_cover.planning.ocp import Settings
from mpc_cover.planning.scp import SHARPNESS, SCPResult, length_scale, softness_at
from mpc_cover.planning.scp import evaluate as evaluate_motion

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.local_frame import LocalFrame
    from mpc_cover.planning.cvxpy_extra.extra import Extra, Parts
    from mpc_cover.planning.cvxpy_reference import CvxpySubproblem
    from mpc_cover.planning.ocp import OCP

_ELASTIC = 1e3
"""Weight of violations while an iterate is restored, in units of the proximal term's weight; a plain choice."""
SOLVER_OPTIONS: dict[str, dict[str, Any]] = {
    "OSQP": {"eps_abs": 1e-5, "eps_rel": 1e-5, "max_iter": 20_000},
    "SCS": {"eps_abs": 1e-6, "eps_rel": 1e-6, "max_iters": 20_000},
}
"""Options of first-order methods; measured: tighter ones end in user_limit and take ten times as long."""


@dataclass
class StatusLog:
    """CVXPY's statuses of all subproblems of a search.

    Attributes
    ----------
    solver : CVXPY's name of the back-end.
    counts : how many subproblems ended with each status.
    last : the last one's.
    """

    solver: str
    counts: Counter[str] = field(default_factory=Counter)
    last: str = ""

    def note(self, status: str) -> str:
        """Take in the status of a subproblem, and return it."""
        self.counts[status] += 1
        self.last = status
        return status

    def to_dict(self) -> dict[str, Any]:
        """Return the log as plain data."""
        return {"solver": self.solver, "status": self.last, "statuses": dict(sorted(self.counts.items()))}


@dataclass(frozen=True, eq=False)
class Found:
    """A motion and its evaluation.

    Attributes
    ----------
    result : of the mission's own cost and constraints, in local units.
    extra : of the user's parts, None without any.
    length : the local unit [m].
    """

    result: SCPResult
    extra: Evaluation | None
    length: float

    @property
    def holds(self) -> bool:
        """Whether it keeps the constraints, the user's included."""
        return self.result.feasible and (self.extra is None or self.extra.holds)

    @property
    def complete(self) -> bool:
        """Whether there is nothing left to gain: everything is covered, all holds, and a user has no terms."""
        return self.holds and self.result.complete and not (self.extra is not None and self.extra.terms)

    @property
    def merit(self) -> float:
        """J with the user's terms, in local units."""
        return self.result.merit + (0.0 if self.extra is None else self.extra.value / self.length)

    @property
    def rank(self) -> tuple[bool, bool, float]:
        """Sort key: the user's constraints, the mission's, then J with the user's terms, or the violation."""
        violated = self.extra is not None and not self.extra.holds
        feasible = self.result.feasible
        return violated, not feasible, self.merit if feasible else self.result.violation


class UserProblem:
    """The OCP of a mission with the terms and constraints of a user: subproblems, their solution, evaluations."""

    def __init__(
        self,
        ocp: OCP,
        mission: Mission,
        frame: LocalFrame,
        extra: Extra | None,
        log: StatusLog,
        *,
        exact_cones: bool = False,
    ) -> None:
        self.ocp, self.mission, self.frame, self.extra, self.log = ocp, mission, frame, extra, log
        self._exact_cones = exact_cones
        self._start = mission.fleet.start if ocp.ends.start_position is not None else None

    def settings(self, sharpness: float = SHARPNESS[0]) -> Settings:
        """Return the settings of a stage."""
        return Settings(softness_at(sharpness, length_scale(self.ocp)), exact_cones=self._exact_cones)

    def metric(self, x: FloatArray) -> Trajectory:
        """Return the motion of a decision vector [m], with a sample each control period, as it is recorded."""
        position, velocity = self.ocp.motion(x)
        force = np.diff(velocity, axis=0) / self.ocp.period
        motion = Trajectory.even(0.0, self.ocp.period, position, velocity, force)
        return self.frame.metric(motion.subdivided(self.mission.spec.control.substeps), self._start)

    def judged(self, x: FloatArray) -> Evaluation | None:
        """Return the evaluation of the user's parts, None without any."""
        return None if self.extra is None else evaluate(self.extra, self.metric(x), self.mission)

    def found(self, x: FloatArray) -> Found:
        """Return a decision vector's evaluation."""
        return Found(evaluate_motion(self.ocp, x), self.judged(x), self.frame.length)

    def merit(self, problem: CoverageNLP, x: FloatArray) -> float:
        """Return J_beta with the penalty of violations and the user's terms, in local units."""
        weight, judged = problem.settings.penalty, self.judged(x)
        own = problem.measure(x).merit(weight)
        return own if judged is None else own + (judged.value + weight * judged.violation) / self.frame.length

    def step(self, problem: CoverageNLP, x: FloatArray, radius: float) -> tuple[str, FloatArray | None, float]:
        """Solve the subproblem around `x`: CVXPY's status, the next decision vector if there is one, and its merit."""
        subproblem = build_cvxpy_subproblem(self.ocp, problem.settings, problem.requirements, x, radius)
        if (parts := self._parts(subproblem, x)) is not None:
            subproblem.terms.append(parts.total / self.frame.length)
            subproblem.constraints += parts.constraints
        return self.solve(subproblem)

    def nearest(self, x: FloatArray, *, groups: set[str] | None = None) -> tuple[str, FloatArray | None]:
        """Solve for the motion nearest to `x` that keeps the user's constraints, all or those of some `groups`."""
        problem = CoverageNLP(self.ocp, self.settings())
        subproblem = build_cvxpy_motion(self.ocp, problem.settings, problem.requirements, x, np.inf)
        if (parts := self._parts(subproblem, x)) is not None:
            chosen = [one for one in parts.groups if groups is None or one.name in groups]
            subproblem.constraints += [constraint for group in chosen for constraint in group.constraints]
        return self.solve(subproblem)[:2]

    def nearer(self, x: FloatArray) -> FloatArray | None:
        """Return a motion near `x` that violates the user's constraints less, where none that keeps them is near."""
        problem = CoverageNLP(self.ocp, self.settings())
        subproblem = build_cvxpy_motion(self.ocp, problem.settings, problem.requirements, x, np.inf)
        parts = self._parts(subproblem, x)
        assert parts is not None
        for constraint in parts.constraints:
            relaxed, violation = _relaxed(constraint)
            subproblem.constraints.append(relaxed)
            subproblem.terms.append(_ELASTIC * problem.settings.proximal * violation / self.frame.length)
        return self.solve(subproblem)[1]

    def solve(self, subproblem: CvxpySubproblem) -> tuple[str, FloatArray | None, float]:
        """Solve a subproblem by the back-end: CVXPY's status, the decision vector, None without one, and the value.

        Raises
        ------
        UserError
            The back-end cannot solve problems of this kind.
        """
        problem, solver = subproblem.problem(), self.log.solver
        with quiet():
            try:
                problem.solve(solver=solver, canon_backend=cp.SCIPY_CANON_BACKEND, **SOLVER_OPTIONS.get(solver, {}))
            except cp.error.SolverError:
                self._require_able(problem)
                return self.log.note(cp.SOLVER_ERROR), None, np.nan
        status = self.log.note(str(problem.status))
        if status not in USABLE or subproblem.velocity.value is None:
            return status, None, np.nan
        x = self.ocp.exact_ends(self.ocp.decision(subproblem.position.value[0], subproblem.velocity.value))
        return status, x if np.isfinite(x).all() else None, float(problem.value)

    def _parts(self, subproblem: CvxpySubproblem, x: FloatArray) -> Parts | None:
        if self.extra is None:
            return None
        motion = MotionVariables.planned(subproblem, self.frame, self.metric(x), self.mission.fleet.ids)
        return self.extra.parts(motion, self.mission)

    def _require_able(self, problem: Any) -> None:
        """Refuse a back-end that takes no problem of this kind, as QP solvers take no cones."""
        try:
            problem.get_problem_data(self.log.solver, canon_backend=cp.SCIPY_CANON_BACKEND)
        except cp.error.SolverError:
            what = f"with extra {self.extra.name} " if self.extra is not None else ""
            raise UserError(
                f"--backend {self.log.solver.lower()}: solves no problem like this one {what}"
                "(a QP solver takes no norms, cones or exponentials): use clarabel or scs"
            ) from None


def _relaxed(constraint: Any) -> tuple[Any, Any]:
    """Return a constraint that may be violated, and by how much in all; those of unusual cones as they are."""
    if isinstance(constraint, cp.constraints.nonpos.Inequality):
        slack = cp.Variable(constraint.expr.shape, nonneg=True)
        return constraint.expr <= slack, cp.sum(slack)
    if isinstance(constraint, cp.constraints.zero.Equality | cp.constraints.zero.Zero):
        slack = cp.Variable(constraint.expr.shape)
        return constraint.expr == slack, cp.sum(cp.abs(slack))
    return constraint, cp.Constant(0.0)
