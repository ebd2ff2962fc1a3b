"""Offline planning: one solve of the optimal coverage NLP over a mission's planning duration (thesis 4.3.3)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.errors import UserError
from mpc_cover.information.build import make_map
from mpc_cover.information.replay import measured_at
from mpc_cover.model.cell_blocks import CellBlocks
from mpc_cover.model.fleet_constraints import FleetConstraints
from mpc_cover.model.local_frame import LocalFrame
from mpc_cover.model.look_instants import looks_of_plans
from mpc_cover.planning.budget import Budget
from mpc_cover.planning.cvxpy_extra.solver_names import check_solver
from mpc_cover.planning.free_horizon import Watcher
from mpc_cover.planning.min_time import FAILURES
from mpc_cover.planning.multistart import Search
from mpc_cover.planning.planner import Planner
from mpc_cover.planning.task import End, Task
from mpc_cover.trajectory_file import Recording
from mpc_cover.version import __version__
from solvers.backends.registry import backends_with_cones
from solvers.outcome import Outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from mpc_cover.mission.load import Mission
    from mpc_cover.planning.candidate import Candidate
    from mpc_cover.planning.cvxpy_extra.extra import Extra

SEARCH = Search(starts=10, finalists=3, rounds=20)
"""The default search; with a time limit its hops go on until then. A plain choice."""


class Formulation(StrEnum):
    """Who makes the convex subproblems."""

    QP = "qp"
    CVXPY = "cvxpy"


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
    keep_on_interrupt : whether a KeyboardInterrupt ends the search alone, and the best plan so far is returned.
    formulation : qp, subproblems assembled by hand; or cvxpy, where the back-end is any solver that CVXPY has.
    extra : a user's terms and constraints, of the formulation cvxpy.
    """

    backend: str = "native"
    seed: int = 0
    starts: int = SEARCH.starts
    time_limit_s: float | None = None
    min_time: bool = False
    exact_cones: bool = False
    keep_on_interrupt: bool = False
    formulation: str = Formulation.QP.value
    extra: Extra | None = None

    def __post_init__(self) -> None:
        """Raise `UserError` for options that do not go together, and cones that the back-end lacks."""
        if self.formulation not in set(Formulation):
            raise UserError(f"formulation {self.formulation}: must be {' or '.join(Formulation)}")
        if self.formulation == Formulation.CVXPY:
            if self.min_time:
                raise UserError("formulation cvxpy: searches for no shortest plan: leave min-time out")
            check_solver(self.backend, exact_cones=self.exact_cones)
            return
        if self.extra is not None:
            raise UserError(f"extra {self.extra.name}: is part of CVXPY's subproblem: needs formulation cvxpy")
        if self.exact_cones and self.backend not in (able := backends_with_cones()):
            raise UserError(f"exact cones: {self.backend} has no second-order cones: use {' or '.join(able)}")


@dataclass(frozen=True)
class SearchNews:
    """What a search is doing, as texts.

    Attributes
    ----------
    state : what it tries, and the best plan so far.
    result : the plan that was just found; empty where this is no news of one.
    """

    state: str
    result: str = ""


def plan_mission(
    mission: Mission,
    options: PlanOptions | None = None,
    on_progress: Callable[[SearchNews], None] | None = None,
) -> Recording:
    """Return the best plan found, with the boundary conditions of the mission's `planning` section.

    Deterministic without a time limit. `on_progress` is called with news of the search. The meta of the
    recording holds cost, guess and residuals. A plan that is returned after a
    KeyboardInterrupt has `interrupted` in its meta.

    Raises
    ------
    UserError
        Unknown back-end, or no motion was found that satisfies the constraints.
    """
    options = options or PlanOptions()
    if options.formulation == Formulation.CVXPY:
        return _plan_with_cvxpy(mission, options, on_progress)
    planner, frame = Planner(options.backend), LocalFrame.of(mission)
    task = offline_task(mission, frame)
    duration_s = mission.spec.planning.duration_s
    limit_s = options.time_limit_s
    budget = Budget.unlimited() if limit_s is None else Budget.wall_clock(limit_s)
    search = replace(SEARCH, starts=options.starts, seed=options.seed, exact_cones=options.exact_cones)
    best = _Best(task.period, frame.length, on_progress)

    def searched() -> Candidate:
        if options.min_time:
            return planner.shortest(task, search, budget, best, failures=FAILURES if limit_s is None else None)
        if duration_s is None:  # as long as it takes
            return planner.shortest(task, search, budget, best, failures=0)
        steps = round(duration_s / task.period)
        rounds = SEARCH.rounds if limit_s is None else None
        best.tries(steps)
        return planner.fixed(task, steps, replace(search, rounds=rounds), budget, best.found)

    found, interrupted = best.of(searched, mission, keep=options.keep_on_interrupt)
    return _recording(mission, options, frame, found, planner.qps_answered, interrupted=interrupted)


def _plan_with_cvxpy(
    mission: Mission, options: PlanOptions, on_progress: Callable[[SearchNews], None] | None
) -> Recording:
    """Return the best plan found by subproblems in CVXPY; see `plan_mission`. It may violate a user's constraint."""
    from mpc_cover.planning.cvxpy_extra.evaluation import evaluate  # noqa: PLC0415 - CVXPY takes a second
    from mpc_cover.planning.cvxpy_problem import StatusLog  # noqa: PLC0415 - likewise
    from mpc_cover.planning.cvxpy_search import CvxpySearch  # noqa: PLC0415 - likewise

    frame = LocalFrame.of(mission)
    task, duration_s, limit_s = offline_task(mission, frame), mission.spec.planning.duration_s, options.time_limit_s
    budget = Budget.unlimited() if limit_s is None else Budget.wall_clock(limit_s)
    search = replace(SEARCH, starts=options.starts, seed=options.seed, exact_cones=options.exact_cones)
    best, log = _Best(task.period, frame.length, on_progress), StatusLog(options.backend.upper())
    run = CvxpySearch(task, mission, frame, search, options.extra, log, budget, best.keep, best.found)

    def searched() -> Candidate:
        return run.as_long_as_it_takes() if duration_s is None else run.fixed(round(duration_s / task.period))

    found, interrupted = best.of(searched, mission, keep=options.keep_on_interrupt)
    recording = _recording(mission, options, frame, found, {}, interrupted=interrupted)
    told: dict[str, Any] = {"formulation": options.formulation, "cvxpy": log.to_dict()}
    told["subproblems"] = sum(log.counts.values())
    if not interrupted and found.cost > 0.0:
        told["stopped"] = "Time is up." if budget.exhausted else "The most promising guesses are refined."
    if options.extra is not None:
        told["extra"] = options.extra.name
        told["extra_value"] = evaluate(options.extra, recording.plain(), mission).value
    return replace(recording, meta={**recording.meta, **told})


def offline_task(mission: Mission, frame: LocalFrame | None = None) -> Task:
    """Return the task of covering a mission from scratch: in metres, or in a local frame with small cells in blocks."""
    planning = mission.spec.planning
    nowhere = np.full_like(mission.fleet.start, np.nan)  # no cell is in range before the start
    demand = make_map(mission).demand(0.0, nowhere)
    end = End(planning.end)
    goal = np.array([agent.end_m for agent in mission.spec.fleet.agents]) if end is End.FIXED else None
    if frame is not None and (blocks := CellBlocks.of(mission)) is not None:
        mission, demand = blocks.mission(mission), demand.of_blocks(blocks)
    if frame is not None:
        mission, goal = frame.mission(mission), None if goal is None else frame.position(goal)
    fleet = mission.fleet
    return Task(
        FleetConstraints.of(fleet, look_instants=looks_of_plans(mission, mission.spec.control.plan_step)),
        mission.field.cell,
        demand.gamma * mission.field.weight,
        fleet.start,
        np.zeros_like(fleet.start),
        0.0,
        mission.spec.control.plan_step,
        start_free=planning.start == "free",
        end=end,
        goal=goal,
        looks=demand.looks,
    )


class _Best(Watcher):
    """Keeps the best of the plans that a search tells of, and passes the news on as texts."""

    def __init__(self, period: float, unit_m: float, on_progress: Callable[[SearchNews], None] | None) -> None:
        self.best: Candidate | None = None
        self._period, self._unit_m, self._on_progress = period, unit_m, on_progress or (lambda _: None)
        self._tried = self._said = ""

    def of(self, search: Callable[[], Candidate], mission: Mission, *, keep: bool) -> tuple[Candidate, bool]:
        """Return what a search finds, and whether Ctrl-C ended it: then the best plan so far, if that is to be kept.

        Raises
        ------
        UserError
            No motion was found that satisfies the constraints.
        """
        try:
            found, interrupted = search(), False
        except KeyboardInterrupt:
            if not keep or self.best is None:
                raise
            found, interrupted = self.best, True
        if not found.feasible:
            raise UserError(f"mission {mission.spec.name}: no motion was found that keeps all its constraints")
        return found, interrupted

    def tries(self, steps: int) -> None:
        """Say that plans of so many steps are looked for."""
        self._tried = f"tries {steps * self._period:.4g} s"
        self._on_progress(SearchNews(self._state))

    def found(self, steps: int, candidate: Candidate) -> None:
        """Take in a plan of so many steps: a shorter one is better where both cover everything."""
        self.keep(steps, candidate)
        result = self._described(steps, candidate)
        self._on_progress(SearchNews(self._state, "" if result == self._said else result))
        self._said = result

    @property
    def _state(self) -> str:
        best = "no plan yet" if self.best is None else self._described(self.best.plan.steps, self.best)
        return f"{self._tried}; best so far {best}"

    def _described(self, steps: int, candidate: Candidate) -> str:
        outcome = "covers everything" if candidate.complete else f"J = {self._unit_m * candidate.cost:.4g} m"
        return f"{steps * self._period:.4g} s: {outcome} ({candidate.origin.name})"

    def keep(self, steps: int, candidate: Candidate) -> None:
        """Take in a plan of so many steps: a shorter one is better where both cover everything."""
        del steps
        if candidate.feasible and (self.best is None or self._merit(candidate) <= self._merit(self.best)):
            self.best = candidate

    @staticmethod
    def _merit(candidate: Candidate) -> tuple[bool, float]:
        return not candidate.complete, candidate.plan.steps if candidate.complete else candidate.cost


def _recording(
    mission: Mission,
    options: PlanOptions,
    frame: LocalFrame,
    found: Candidate,
    answered: Mapping[str, int],
    *,
    interrupted: bool,
) -> Recording:
    substeps = mission.spec.control.substeps  # looks count once a period
    given = mission.spec.planning.start == "fixed"
    plan = frame.metric(found.plan.subdivided(substeps), mission.fleet.start if given else None)
    return Recording(
        time=plan.time,
        position=plan.position,
        velocity=plan.velocity,
        input=plan.input,
        cell=mission.field.cell,
        covered_at=measured_at(mission, plan.time, plan.position, plan.velocity),
        agent_id=mission.fleet.ids,
        mission=mission,
        meta={
            "kind": "plan",
            "version": __version__,
            "seed": options.seed,
            "backend": options.backend,
            "cost_m": frame.length * found.cost,
            "guess": found.origin.name,
            "qps": dict(answered),
            **_solver_meta(found),
            **({"interrupted": True, "stopped": "Interrupted: the best plan until then."} if interrupted else {}),
        },
    )


def _solver_meta(found: Candidate) -> dict[str, Any]:
    """Return why the search stopped, and the residuals of the last subproblem."""
    stages = found.refined.stages if found.refined is not None else ()
    if found.cost == 0.0:
        stopped = "Everything is covered: J = 0 is the minimum."
    elif stages:
        last = stages[-1]
        stopped = last.outcome.sentence + (f" ({last.detail})" if last.outcome is Outcome.SUBPROBLEM_FAILED else "")
    else:
        stopped = "No start could be refined in time."
    meta: dict[str, Any] = {"stopped": stopped, "subproblems": sum(stage.iterations for stage in stages)}
    residuals = next((stage.residuals for stage in reversed(stages) if stage.residuals is not None), None)
    if residuals is not None:
        meta["kkt_residual"] = max(residuals.primal, residuals.dual)
    return meta
