"""The ladder: a verified new plan, else the previous one shifted, else the brake."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from mpc_cover.control.horizon import ended_at_rest

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.control.planning_constraints import PlanningConstraints
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory


class PlanSource(Enum):
    """Where the plan of a step comes from, best first."""

    NEW = "a verified new plan"
    SHIFTED = "the previous plan, shifted"
    BRAKE = "braking to rest"
    REST = "at rest, nothing to do"


@dataclass(frozen=True, eq=False)
class StepResult:
    """What a control step came out with.

    Attributes
    ----------
    plan : verified, from the step's start time on, ending at rest.
    rung : how good it is.
    reason : why it is no better, or what was done, in a sentence.
    computing_time_s : what the step took.
    deadline_missed : whether it took longer than it was given.
    """

    plan: Trajectory
    plan_source: PlanSource
    reason: str
    computing_time_s: float
    deadline_missed: bool


class FallbackPolicy:
    """Chooses what is flown; all of it has passed the verifier, but for the last brake.

    Attributes
    ----------
    published : what is flown so far.
    """

    def __init__(self, constraints: PlanningConstraints) -> None:
        self._constraints = constraints
        self.published: Trajectory | None = None

    def best(self, start: FleetState, whole: Trajectory | None, reason: str) -> tuple[Trajectory, PlanSource, str]:
        """Cut the horizon out of the mission plan, end it at rest, verify it; else go down the ladder."""
        if whole is not None:
            for plan in ended_at_rest(whole, self._constraints.mission):
                if self._constraints.keeps(plan, start):
                    return plan, PlanSource.NEW, reason
        reason = "no new plan passed the verifier"
        shifted = self._shifted(start)
        return (
            (shifted, PlanSource.SHIFTED, reason)
            if shifted
            else (self._constraints.brake(start), PlanSource.BRAKE, reason)
        )

    def stop(self, start: FleetState, reason: str) -> tuple[Trajectory, PlanSource, str]:
        """Come to rest: at once if that is safe, else along the plan that was verified."""
        stop = self._constraints.brake(start)
        if self._constraints.keeps(stop, start) or self.published is None:
            return stop, PlanSource.REST, reason
        shifted = self._shifted(start)
        return (shifted, PlanSource.SHIFTED, reason) if shifted else (stop, PlanSource.BRAKE, reason)

    def state_at(self, time: float) -> tuple[FloatArray, FloatArray] | None:
        """Return the state (m, d) [m], [m/s] that the published plan has at one of its samples; None outside."""
        plan = self.published
        sample = -1 if plan is None else round((time - plan.start_time) / plan.period)
        return None if plan is None or not 0 <= sample <= plan.steps else (plan.position[sample], plan.velocity[sample])

    def _shifted(self, start: FleetState) -> Trajectory | None:
        """Return what is left of the published plan, if that is still well."""
        if self.published is None:
            return None
        shifted = self.published.remainder(start.time, start.position, start.velocity)
        return shifted if self._constraints.keeps(shifted, start) else None
