"""The receding-horizon controller: it knows the rest of the mission and refines the stretch ahead.

A plan for the whole mission is made before anyone moves. Each step re-solves the stretch within the horizon
from the newest state, asking for the same coverage a sample sooner, and splices it into the mission plan.
What is published is that stretch, ended at rest and verified.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.control.fallback import Rung, brake, brake_plan, plan_from_velocities, shifted_plan
from mpc_cover.information.coverage_map import CoverageMap
from mpc_cover.model.sensing import measured
from mpc_cover.planning.engine import Engine, resampled
from mpc_cover.planning.planner import Task
from mpc_cover.planning.window import Window
from mpc_cover.verification.motion import verify_motion

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.planning.plan import Plan

_QPS = 2
"""QPs a step at the most: the rest of the budget is for what goes wrong."""
_START_TOLERANCE = 1e-9


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

    plan: Plan
    rung: Rung
    reason: str
    computing_time_s: float
    deadline_missed: bool


class RecedingHorizon:
    """The brain of the daemon and of the simulation.

    Parameters
    ----------
    mission : what to cover, with whom.
    backend : QP back-end: piqp, clarabel or osqp.
    seed : of whatever is random; the controller itself is deterministic without deadlines.
    """

    def __init__(self, mission: Mission, *, backend: str = "piqp", seed: int = 0) -> None:
        self._mission = mission
        self._fleet = mission.fleet
        self._period = mission.spec.control.period_s
        self._horizon = mission.spec.control.horizon_steps
        self._engine = Engine(backend)
        self.seed = seed
        self.coverage = CoverageMap(mission)
        self._whole: Plan | None = None
        self._published: Plan | None = None

    def prepare(
        self, position: FloatArray, velocity: FloatArray, start_time: float, *, deadline: float | None
    ) -> StepResult:
        """Plan the whole mission from (m, d) `position` [m], thoroughly, and return its first stretch.

        For a fleet at rest; `deadline` is on `time.perf_counter`, None for none.
        """
        begun = time.perf_counter()
        if self.coverage.complete:
            return self._finish(begun, deadline, self._stopping(position, velocity, start_time), Rung.REST, "all is covered")
        candidate = self._engine.whole(self._task(position, velocity, start_time), deadline)
        self._whole = candidate.plan if candidate.feasible else None
        return self._publish(begun, deadline, position, velocity, start_time, candidate.kind)

    def step(
        self, position: FloatArray, velocity: FloatArray, start_time: float, *, deadline: float | None
    ) -> StepResult:
        """Return the plan from the predicted (m, d) state at `start_time` on; never raises for numerical trouble."""
        begun = time.perf_counter()
        if self.coverage.complete:
            stop = self._stopping(position, velocity, start_time)
            if self._verified(stop, position, velocity):
                return self._finish(begun, deadline, stop, Rung.REST, "all is covered")
            return self._fall_back(begun, deadline, position, velocity, start_time, "all is covered")
        reason = "replanned"
        whole = self._rest_of_whole(position, velocity, start_time)
        if whole is None:
            task = self._task(position, velocity, start_time)
            candidate = self._engine.quick(task, deadline)
            self._whole = candidate.plan if candidate.feasible else None
        else:
            self._whole, reason = self._improved(whole, deadline)
        return self._publish(begun, deadline, position, velocity, start_time, reason)

    def _task(self, position: FloatArray, velocity: FloatArray, start_time: float) -> Task:
        weight = self.coverage.owed.astype(float)
        cell = self._mission.field.cell
        return Task(self._fleet, cell, weight, position, velocity, start_time, self._period)

    def _rest_of_whole(self, position: FloatArray, velocity: FloatArray, start_time: float) -> Plan | None:
        """Return what is left of the mission plan from this state on, or None when it is over or of no use."""
        whole = self._whole
        if whole is None:
            return None
        done = round((start_time - whole.start_time) / self._period)
        if not 0 <= done < whole.steps:
            return None
        rest = plan_from_velocities(position, velocity, whole.velocity[done + 1 :], start_time, self._period)
        return rest if self._verified(rest, position, velocity) else None

    def _improved(self, whole: Plan, deadline: float | None) -> tuple[Plan, str]:
        """Re-solve the stretch within the horizon, a sample shorter if all that was to be covered still is."""
        steps = self._stretch(whole)
        tail = whole.position[steps:]
        weight = self._left_by(tail)
        window = self._window(whole, weight, steps)
        now = self._engine.judge(window, whole.velocity[1 : steps + 1].ravel())
        if steps > 2 and now.cost == 0.0:  # noqa: PLR2004 - nothing to be gained
            sooner = self._window(whole, weight, steps - 1)
            guess = resampled(whole.velocity[: steps + 1], steps - 1)[1:].ravel()
            found = self._engine.polish(sooner, guess, _QPS, deadline)
            if found.feasible and found.cost == 0.0:
                spliced = self._spliced(whole, found.x, steps, steps - 1)
                if self._verified(spliced, whole.position[0], whole.velocity[0]):
                    return spliced, "a sample sooner"
            return whole, "no sample sooner"
        found = self._engine.polish(window, whole.velocity[1 : steps + 1].ravel(), _QPS, deadline)
        if found.feasible and found.cost < now.cost:
            spliced = self._spliced(whole, found.x, steps, steps)
            if self._verified(spliced, whole.position[0], whole.velocity[0]):
                return spliced, "more coverage"
        return whole, "no better"

    def _stretch(self, whole: Plan) -> int:
        """Return how many samples of the mission plan the horizon re-solves; the rest of it is for braking."""
        if whole.steps <= self._horizon:
            return whole.steps
        fastest = float((self._fleet.speed_max / self._fleet.input_max).max())
        return max(1, self._horizon - int(np.ceil(fastest / self._period - 1e-9)))

    def _window(self, whole: Plan, weight: FloatArray, steps: int) -> Window:
        stretch = self._stretch(whole)
        last = stretch == whole.steps
        return Window(
            fleet=self._fleet,
            cell=self._mission.field.cell,
            weight=weight,
            position=whole.position[0],
            velocity=whole.velocity[0],
            steps=steps,
            period=self._period,
            end_position=None if last else whole.position[stretch],
            end_velocity=whole.velocity[stretch],
        )

    def _left_by(self, tail: FloatArray) -> FloatArray:
        """Return the weights (J, K) of what is owed and not covered by later samples of the mission plan."""
        owed: BoolArray = self.coverage.owed
        for position in tail[1:]:
            owed = owed & ~measured(position, self._mission.field.cell, self._fleet.radius)
        return owed.astype(float)

    def _spliced(self, whole: Plan, x: FloatArray, old: int, new: int) -> Plan:
        """Return the mission plan with its first `old` samples replaced by `new` ones."""
        first = x.reshape(new, *whole.velocity.shape[1:])
        later = np.concatenate([first, whole.velocity[old + 1 :]])
        return plan_from_velocities(whole.position[0], whole.velocity[0], later, whole.start_time, self._period)

    def _publish(
        self,
        begun: float,
        deadline: float | None,
        position: FloatArray,
        velocity: FloatArray,
        start_time: float,
        reason: str,
    ) -> StepResult:
        """Cut the horizon out of the mission plan, end it at rest, verify it; else go down the ladder."""
        if self._whole is not None:
            for plan in self._ended_at_rest(self._whole):
                if self._verified(plan, position, velocity):
                    return self._finish(begun, deadline, plan, Rung.NEW, reason)
        return self._fall_back(begun, deadline, position, velocity, start_time, "no new plan passed the verifier")

    def _ended_at_rest(self, whole: Plan) -> list[Plan]:
        """Return stretches of the mission plan that end at rest within the horizon, longest first."""
        start, later = (whole.position[0], whole.velocity[0]), whole.velocity[1:]
        if whole.steps <= self._horizon:
            rest = np.zeros((self._horizon - whole.steps, *later.shape[1:]))
            padded = np.concatenate([later, rest])
            return [plan_from_velocities(*start, padded, whole.start_time, self._period)]
        plans = []
        for kept in range(self._stretch(whole), 0, -1):
            braking = brake(later[kept - 1], self._fleet, self._period)
            room = self._horizon - kept - braking.shape[0]
            if room >= 0:
                rest = np.zeros((room, *later.shape[1:]))
                velocities = np.concatenate([later[:kept], braking, rest])
                plans.append(plan_from_velocities(*start, velocities, whole.start_time, self._period))
        return plans

    def _fall_back(
        self,
        begun: float,
        deadline: float | None,
        position: FloatArray,
        velocity: FloatArray,
        start_time: float,
        reason: str,
    ) -> StepResult:
        """Return the shifted previous plan if it still verifies, else brake."""
        if self._published is not None:
            shifted = shifted_plan(self._published, position, velocity, start_time)
            if self._verified(shifted, position, velocity):
                return self._finish(begun, deadline, shifted, Rung.SHIFTED, reason)
        stop = self._stopping(position, velocity, start_time)
        return self._finish(begun, deadline, stop, Rung.BRAKE, reason)

    def _stopping(self, position: FloatArray, velocity: FloatArray, start_time: float) -> Plan:
        return brake_plan(position, velocity, self._fleet, start_time, self._period, self._horizon)

    def _verified(self, plan: Plan, position: FloatArray, velocity: FloatArray) -> bool:
        report = verify_motion(
            self._fleet,
            plan.time(),
            plan.position,
            plan.velocity,
            plan.input,
            at_rest=True,
            start=(position, velocity),
        )
        return report.holds

    def _finish(self, begun: float, deadline: float | None, plan: Plan, rung: Rung, reason: str) -> StepResult:
        self._published = plan
        now = time.perf_counter()
        return StepResult(plan, rung, reason, now - begun, deadline is not None and now > deadline)
