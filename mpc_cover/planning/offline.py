"""One offline solve of the optimal coverage NLP over a mission's planning duration (thesis 4.3.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover import __version__
from mpc_cover.errors import InvalidInputError, Problem, UserError
from mpc_cover.model.sensing import covered_at
from mpc_cover.planning.engine import Engine
from mpc_cover.planning.planner import Search
from mpc_cover.planning.task import Task
from mpc_cover.trajectory import Trajectory

if TYPE_CHECKING:
    from mpc_cover.mission.load import Mission


def plan_mission(
    mission: Mission, *, backend: str = "piqp", seed: int = 0, deadline: float | None = None
) -> Trajectory:
    """Return the best plan found for the mission's `planning.duration_s`, from the start at rest to rest.

    Deterministic without a `deadline` (on `time.perf_counter`); `seed` is kept with the result.

    Raises
    ------
    InvalidInputError
        The duration is shorter than two periods.
    UserError
        Unknown back-end, or no motion keeps the constraints.
    """
    engine, period = Engine(backend), mission.spec.control.period_s
    steps = round(mission.spec.planning.duration_s / period)
    if steps < 2:  # noqa: PLR2004 - to leave and to stop
        problem = Problem("planning.duration_s", mission.spec.planning.duration_s, "must be at least two periods")
        raise InvalidInputError(f"mission {mission.spec.name}", [problem])
    start = mission.fleet.start
    weight = np.tile(mission.field.weight, (mission.fleet.radius.shape[1], 1))
    planning = mission.spec.planning
    task = Task(
        mission.fleet,
        mission.field.cell,
        weight,
        start,
        np.zeros_like(start),
        0.0,
        period,
        start_free=planning.start == "free",
        end=planning.end,
        goal=np.array([agent.end_m for agent in mission.spec.fleet.agents]) if planning.end == "fixed" else None,
    )
    found = engine.fixed(task, steps, Search(starts=10, finalists=3, seed=seed), deadline)
    if not found.feasible:
        raise UserError(f"mission {mission.spec.name}: no motion was found that keeps separation and connectivity")
    plan = found.plan
    first = covered_at(plan.time(), plan.position, mission.field.cell, mission.fleet.radius)
    meta = {"kind": "plan", "version": __version__, "seed": seed, "backend": backend, "cost_m": found.cost}
    return Trajectory(
        time=plan.time(),
        position=plan.position,
        velocity=plan.velocity,
        input=plan.input,
        cell=mission.field.cell,
        covered_at=first,
        agent_id=mission.fleet.ids,
        mission=mission,
        meta={**meta, "guess": found.kind},
    )
