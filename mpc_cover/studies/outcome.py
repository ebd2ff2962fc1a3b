"""A step of the controllers that the receding horizon is compared with."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpc_cover.control.fallback_policy import PlanSource

if TYPE_CHECKING:
    from mpc_cover.model.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Step:
    """What a step came out with; see `control.control_law.StepOutcome`."""

    plan: Trajectory
    plan_source: PlanSource
    reason: str
    computing_time_s: float
    deadline_missed: bool


def stepped(
    begun: float, deadline: float | None, plan: Trajectory, reason: str, plan_source: PlanSource = PlanSource.NEW
) -> Step:
    """Return the step that began at `begun` on `time.perf_counter`, as `deadline` is."""
    now = time.perf_counter()
    return Step(plan, plan_source, reason, now - begun, deadline is not None and now > deadline)
