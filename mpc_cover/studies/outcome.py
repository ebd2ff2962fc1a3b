"""A step of the controllers that the receding horizon is compared with."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpc_cover.control.fallback import Rung

if TYPE_CHECKING:
    from mpc_cover.planning.plan import Plan


@dataclass(frozen=True, eq=False)
class Step:
    """What a step came out with; see `service.brain.StepOutcome`."""

    plan: Plan
    rung: Rung
    reason: str
    computing_time_s: float
    deadline_missed: bool


def stepped(begun: float, deadline: float | None, plan: Plan, reason: str, rung: Rung = Rung.NEW) -> Step:
    """Return the step that began at `begun` on `time.perf_counter`, as `deadline` is."""
    now = time.perf_counter()
    return Step(plan, rung, reason, now - begun, deadline is not None and now > deadline)
