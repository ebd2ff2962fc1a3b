"""The receding-horizon controller: it knows the rest of the mission and refines the stretch ahead.

A plan for the whole mission is made before anyone moves. Each step re-solves the stretch within the horizon
from the newest state, asking for the same coverage a sample sooner, and splices it into the mission plan.
What is published is that stretch, ended at rest and verified.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from mpc_cover.control.footing import Footing
from mpc_cover.control.ladder import Ladder, StepResult
from mpc_cover.control.orders import Orders
from mpc_cover.control.prospects import Prospects
from mpc_cover.control.reunion import apart, reunions
from mpc_cover.control.second_thoughts import SecondThoughts, stays
from mpc_cover.control.stretch import Start, spliced, stretch_steps, stretch_window
from mpc_cover.information.build import make_map
from mpc_cover.planning.continuation import EXPOSED
from mpc_cover.planning.deadline import part_of
from mpc_cover.planning.engine import Engine
from mpc_cover.planning.stretches import resampled

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.control.courses import Course
    from mpc_cover.control.fallback import Rung
    from mpc_cover.mission.load import Mission
    from mpc_cover.planning.plan import Plan
    from mpc_cover.planning.task import Candidate, Task

_QPS = 2
"""QPs a step at the most: the rest of the budget is for what goes wrong."""
_SHARE = 0.3
"""Part of the time for a step that polishing may take: a plan that is good already needs no more."""
_LAST = 3
"""So few samples before its end a mission plan that leaves something owed gives way to the next."""


class RecedingHorizon:
    """The brain of the daemon and of the simulation.

    Parameters
    ----------
    mission : what to cover, with whom.
    backend : QP back-end: piqp, clarabel or osqp.
    seed : of whatever is random; the controller itself is deterministic without deadlines.

    Attributes
    ----------
    coverage : what was measured, and what is owed.
    """

    def __init__(self, mission: Mission, *, backend: str = "piqp", seed: int = 0) -> None:
        self._footing = Footing(mission)
        self._mission = self._footing.mission
        self._period = mission.spec.control.period_s
        self._engine = Engine(backend)
        self.seed = seed
        self.coverage = make_map(mission)
        self._orders = Orders(self.coverage, mission.field)
        self._thoughts = SecondThoughts(mission.spec.control.planning_time_s)
        self._whole: Plan | None = None
        self._reunites = False
        self._ladder = Ladder(self._footing)
        self._prospects = Prospects(mission, self._footing, self._orders)

    @property
    def wants_thought(self) -> bool:
        """Whether the fleet should rest for a thorough plan (`prepare`): steps are too short, or find none."""
        return self._thoughts.wanted

    @property
    def unreachable(self) -> BoolArray:
        """(J, K): what is owed, but cannot be measured by any of those who are left."""
        return self.coverage.owed & ~self._footing.measurable

    def prepare(
        self, position: FloatArray, velocity: FloatArray, start_time: float, *, deadline: float | None
    ) -> StepResult:
        """Plan the whole mission from (m, d) `position` [m], thoroughly, and return its first stretch.

        For a fleet at rest; `deadline` is on `time.perf_counter`. Without one the mission's planning time bounds the
        work instead of the time, and the plan is the same every time. Whenever that is too short for a plan worth
        flying, the fleet stays at rest, and the next planning takes twice as long.
        """
        begun = time.perf_counter()
        start = self._begin(position, velocity, start_time)
        if self._nothing_left:
            return self._result(begun, deadline, *self._ladder.stop(start, self._why_stop))
        planning_s, self._whole = self._mission.spec.control.planning_time_s, None
        effort_s = planning_s * self._thoughts.patience
        later = None if deadline is None else deadline + effort_s - planning_s
        self._thoughts.begin()
        reason = self._replan(start, later, partial(self._engine.whole, effort_s=effort_s))
        self._thoughts.end()
        return self._result(begun, later, *self._ladder.best(start, self._whole, reason))

    def step(
        self, position: FloatArray, velocity: FloatArray, start_time: float, *, deadline: float | None
    ) -> StepResult:
        """Return the plan from the predicted (m, d) state at `start_time` on; never raises for numerical trouble."""
        begun = time.perf_counter()
        start = self._begin(position, velocity, start_time)
        if self.wants_thought or (self._nothing_left and not self._footing.parted(start)):
            return self._result(begun, deadline, *self._ladder.stop(start, self._why_stop))
        known, self._whole = self._whole, self._rest_of_whole(start)
        if self._whole is None and known is not None and not self._reunites and start.time < known.end_time:
            self._prospects.former = known
        if self._whole is None or self._reunites or self._runs_out(self._whole, start):
            reason = self._replan(start, deadline, self._engine.quick)
            self._notice_loss(start, deadline)
        else:
            self._whole, reason = self._improved(self._whole, start, deadline)
        return self._result(begun, deadline, *self._ladder.best(start, self._whole, reason))

    def set_lost(self, lost: BoolArray) -> None:
        """Go on without the agents of the (m,) mask, or with them again; the work is shared out anew.

        They stand still where the next step says they are, as obstacles. What only they could measure stays owed.
        """
        if self._footing.set_lost(lost):
            self._start_over()

    def set_courses(self, courses: Mapping[int, Course]) -> None:
        """Keep clear of the lost while they still move, by number; without one they are where they come to rest."""
        self._footing.courses = courses

    def limit_speed(self, index: int, share: float) -> None:
        """Plan for an agent that reaches only this share of its speed."""
        if self._footing.limit_speed(index, share):
            self._start_over()

    def _start_over(self) -> None:
        self._mission = self._footing.mission
        self._prospects.former, self._whole = self._whole or self._prospects.former, None

    def _begin(self, position: FloatArray, velocity: FloatArray, start_time: float) -> Start:
        start = Start(position, velocity, start_time)
        self._footing.take(start, self._ladder.published)
        self._mission = self._footing.mission
        return start

    @property
    def _nothing_left(self) -> bool:
        return not (self.coverage.owed & self._footing.measurable).any()

    @property
    def _why_stop(self) -> str:
        return "all is covered" if self._nothing_left else "stops to think"

    def _replan(self, start: Start, deadline: float | None, search: Callable[[Task, float | None], Candidate]) -> str:
        """Plan what is owed from here, and say how; those whom a loss leaves out of range of each other meet first."""
        footing = self._footing
        parts = apart(start.position, footing.fleet) or footing.parting
        if not parts and (kind := self._cover(start, deadline, search)):
            return kind
        if self._whole is None and (parts or footing.torn):
            plans = reunions(start, footing.fleet, self._period)
            self._whole = next((plan for plan in plans if footing.keeps(plan, start)), None)
            self._reunites = self._whole is not None
        if self._reunites:
            return "meets again"
        in_touch = parts and not apart(start.position, footing.fleet)
        return (self._cover(start, deadline, search) if in_touch else None) or "nothing better was found"

    def _cover(
        self, start: Start, deadline: float | None, search: Callable[[Task, float | None], Candidate]
    ) -> str | None:
        """Take the best plan that is found for what is owed, and return of what kind it is; None if none is."""
        if (best := self._prospects.best(start, deadline, search, self._engine)) is None:
            return None
        idle = best.kind == "rest" and best.cost > 0.0
        if idle and self._whole is not None and not self._reunites:
            return "no way on was found yet"
        in_a_hurry = idle and deadline is not None and self._prospects.former is not None
        self._thoughts.wanted = in_a_hurry or self._is_poor(best, start)
        self._whole, self._reunites, self._prospects.former = best.plan, False, None
        return best.kind

    def _is_poor(self, best: Candidate, start: Start) -> bool:
        """Return whether a plan leaves most of what is owed, so that longer planning is worth while."""
        if best.covers or self.coverage.endless:
            return False
        owed, _ = self._left_by(start.position[None], start)
        left, _ = self._left_by(best.plan.position, start)
        return self._thoughts.is_poor(left, owed)

    def _notice_loss(self, start: Start, deadline: float | None) -> None:
        """See whether a fleet at rest finds no way on in time."""
        here, plan = start.position, self._whole
        in_time = deadline is None or time.perf_counter() <= deadline + self._period
        seen = plan.position if plan is not None and in_time else here[None]
        if not start.velocity.any() and stays(seen, here) and (self._left_by(seen, start)[0] > 0.0).any():
            self._thoughts.strand(here, float(self.coverage.residual.sum()))

    def _runs_out(self, whole: Plan, start: Start) -> bool:
        """Return whether a mission plan has done its part, or is about to end, while more is to be done."""
        if self.coverage.endless:
            return not self.coverage.demand(start.time, start.position).gamma.any()
        if whole.steps > _LAST:
            return False
        weight, looks = self._left_by(whole.position, start)
        return self._orders.more or (looks is not None and bool((weight > 0.0).any()))

    def _rest_of_whole(self, start: Start) -> Plan | None:
        """Return what is left of the mission plan from this state on, or None when it is over or of no use."""
        whole = self._whole
        if whole is None:
            return None
        done = round((start.time - whole.start_time) / self._period)
        if not 0 <= done < whole.steps:
            return None
        rest = start.plan(whole.velocity[done + 1 :], self._period)
        return rest if self._footing.keeps(rest, start) else None

    def _improved(self, whole: Plan, start: Start, deadline: float | None) -> tuple[Plan, str]:
        """Re-solve the stretch within the horizon, a sample shorter if all that was to be covered still is."""
        stretch = stretch_steps(whole, self._mission)
        weight, looks = self._left_by(whole.position[stretch + 1 :], start)
        window = replace(stretch_window(whole, self._mission, weight, stretch, stretch), looks=looks)
        x = window.decision(whole.position[0], whole.velocity[: stretch + 1])
        now = self._engine.judge(window, x)
        sooner = int(now.cost == 0.0 and now.exposure <= EXPOSED and stretch > 2)  # noqa: PLR2004 - no less to gain
        if sooner:
            window = replace(stretch_window(whole, self._mission, weight, stretch, stretch - 1), looks=looks)
            x = window.decision(whole.position[0], resampled(whole.velocity[: stretch + 1], stretch - 1))
        found = self._engine.polish(window, x, _QPS, part_of(deadline, _SHARE))
        better = found.complete if sooner else found.merit < now.merit
        if found.feasible and better:
            plan = spliced(whole, window.motion(found.x)[1], stretch)
            if self._is_safe(plan, whole, start):
                return plan, "a sample sooner" if sooner else "more coverage"
        return whole, "no sample sooner" if sooner else "no better"

    def _is_safe(self, plan: Plan, known: Plan, start: Start) -> bool:
        """Return whether a plan is as safe as the known one, whoever misses it, and whoever stops."""
        footing = self._footing
        before = self._ladder.state_at(start.time - self._period)
        return (
            footing.keeps(plan, start)
            and footing.keeps_if_missed(plan, known)
            and footing.leaves_room(plan, known, before)
        )

    def _left_by(self, later: FloatArray, start: Start) -> tuple[FloatArray, IntArray | None]:
        """Return weights and looks (J, K) of what is asked for and not brought by later positions of the plan."""
        weight, looks = self._orders.left(start, later, self._mission.fleet.radius)
        return weight * self._footing.measurable, looks

    def _result(self, begun: float, deadline: float | None, plan: Plan, rung: Rung, reason: str) -> StepResult:
        self._ladder.published = plan
        now = time.perf_counter()
        return StepResult(plan, rung, reason, now - begun, deadline is not None and now > deadline)
