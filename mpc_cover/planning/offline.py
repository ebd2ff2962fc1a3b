"""Offline planning: one solve of the optimal coverage NLP over a mission's planning duration (thesis 4.3.3)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.errors import UserError
from mpc_cover.information.build import make_map
from mpc_cover.information.replay import measured_at
from mpc_cover.model.fleet_constraints import FleetConstraints
from mpc_cover.model.local_frame import LocalFrame
from mpc_cover.planning.budget import Budget
from mpc_cover.planning.min_time import FAILURES
from mpc_cover.planning.multistart import Search
from mpc_cover.planning.planner import Planner
from mpc_cover.planning.task import End, Task
from mpc_cover.trajectory_file import Recording
from mpc_cover.version import __version__
from solvers.backends.registry import backends_with_cones

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.mission.load import Mission
    from mpc_cover.planning.candidate import Candidate

SEARCH = Search(starts=10, finalists=3, rounds=20)
"""The default search; with a time limit its hops go on until then. A plain choice."""


@dataclass(frozen=True)
class PlanOptions:
    """Options of offline planning.

    Attributes
    ----------
    backend : QP back-end.
    seed : of the random starts.
    starts : guesses that are screened.
    time_limit_s : of the whole search [s], which goes on until then while the plan is incomplete; None for a search
        of bounded effort, which is deterministic.
    min_time : whether to search for the shortest plan that covers the whole demand, instead of a fixed duration.
    exact_cones : second-order cones for speeds, inputs and edges instead of polytopes inside them.
    """

    backend: str = "piqp"
    seed: int = 0
    starts: int = SEARCH.starts
    time_limit_s: float | None = None
    min_time: bool = False
    exact_cones: bool = False

    def __post_init__(self) -> None:
        """Raise `UserError` for cones that the back-end lacks."""
        if self.exact_cones and self.backend not in (able := backends_with_cones()):
            raise UserError(f"exact cones: {self.backend} has no second-order cones: use {' or '.join(able)}")


def plan_mission(
    mission: Mission, options: PlanOptions | None = None, on_progress: Callable[[str], None] | None = None
) -> Recording:
    """Return the best plan found, with the boundary conditions of the mission's `planning` section.

    Deterministic without a time limit. `on_progress` is called with lines of text on the search. The meta of the
    recording holds cost, guess and residuals.

    Raises
    ------
    UserError
        Unknown back-end, or no motion was found that satisfies the constraints.
    """
    options = options or PlanOptions()
    planner, frame = Planner(options.backend), LocalFrame.of(mission)
    task = offline_task(mission, frame)
    steps = round(mission.spec.planning.duration_s / task.period)
    limit_s = options.time_limit_s
    budget = Budget.unlimited() if limit_s is None else Budget.wall_clock(limit_s)
    search = replace(SEARCH, starts=options.starts, seed=options.seed, exact_cones=options.exact_cones)
    notify = _notifier(task.period, frame, on_progress)
    if options.min_time:
        found = planner.shortest(task, search, budget, notify, failures=FAILURES if limit_s is None else None)
    else:
        rounds = SEARCH.rounds if limit_s is None else None
        found = planner.fixed(task, steps, replace(search, rounds=rounds), budget, notify)
    if not found.feasible:
        raise UserError(f"mission {mission.spec.name}: no motion was found that keeps all its constraints")
    return _recording(mission, options, frame, found)


def offline_task(mission: Mission, frame: LocalFrame | None = None) -> Task:
    """Return the task of covering a mission from scratch, in metres or in a local frame."""
    planning = mission.spec.planning
    nowhere = np.full_like(mission.fleet.start, np.nan)  # no cell is in range before the start
    demand = make_map(mission).demand(0.0, nowhere)
    end = End(planning.end)
    goal = np.array([agent.end_m for agent in mission.spec.fleet.agents]) if end is End.FIXED else None
    if frame is not None:
        mission, goal = frame.mission(mission), None if goal is None else frame.position(goal)
    fleet = mission.fleet
    return Task(
        FleetConstraints.of(fleet),
        mission.field.cell,
        demand.gamma * mission.field.weight,
        fleet.start,
        np.zeros_like(fleet.start),
        0.0,
        mission.spec.control.period_s,
        start_free=planning.start == "free",
        end=end,
        goal=goal,
        looks=demand.looks,
    )


def _notifier(
    period: float, frame: LocalFrame, on_progress: Callable[[str], None] | None
) -> Callable[[int, Candidate], None] | None:
    if on_progress is None:
        return None

    def notify(steps: int, candidate: Candidate) -> None:
        outcome = "covers everything" if candidate.complete else f"J = {frame.length * candidate.cost:.4g} m"
        on_progress(f"{steps * period:.4g} s: {outcome} ({candidate.origin.name})")

    return notify


def _recording(mission: Mission, options: PlanOptions, frame: LocalFrame, found: Candidate) -> Recording:
    given = mission.spec.planning.start == "fixed"
    plan = frame.metric(found.plan, mission.fleet.start if given else None)
    return Recording(
        time=plan.time,
        position=plan.position,
        velocity=plan.velocity,
        input=plan.input,
        cell=mission.field.cell,
        covered_at=measured_at(mission, plan.time, plan.position),
        agent_id=mission.fleet.ids,
        mission=mission,
        meta={
            "kind": "plan",
            "version": __version__,
            "seed": options.seed,
            "backend": options.backend,
            "cost_m": frame.length * found.cost,
            "guess": found.origin.name,
            **_solver_meta(found),
        },
    )


def _solver_meta(found: Candidate) -> dict[str, Any]:
    """Return why the search stopped, and the residuals of the last subproblem."""
    stages = found.refined.stages if found.refined is not None else ()
    if found.cost == 0.0:
        stopped = "Everything is covered: J = 0 is the minimum."
    else:
        stopped = stages[-1].outcome.sentence if stages else "No start could be refined in time."
    meta: dict[str, Any] = {"stopped": stopped, "subproblems": sum(stage.iterations for stage in stages)}
    residuals = next((stage.residuals for stage in reversed(stages) if stage.residuals is not None), None)
    if residuals is not None:
        meta["kkt_residual"] = max(residuals.primal, residuals.dual)
    return meta
