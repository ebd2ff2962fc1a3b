"""Plans from scratch: several starts, the best refined, and a length that just suffices."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from mpc_cover.constraints.boundary import Ends
from mpc_cover.model.sensing import measured
from mpc_cover.planning.continuation import SHARPNESS, Refined, judge, refine
from mpc_cover.planning.follow import Motion, follow
from mpc_cover.planning.guesses import Guess, rest_guess, sweep_guesses, tour_guess
from mpc_cover.planning.plan import Plan
from mpc_cover.planning.window import Window

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.fleet import Fleet
    from solvers.backends.base import Backend

COARSE = (2.0, 8.0, 20.0)
"""Stages that tell good starts from bad ones."""
COMPRESSION = 0.84
"""A refined plan needs about this part of the time in which its guess flies."""
_FINALISTS = 3
"""Plans that are flown on to what they leave over, when none covers everything."""
_EXTENSIONS = 3


@dataclass(frozen=True, eq=False)
class Task:
    """What is to be covered, and from where.

    Attributes
    ----------
    fleet : limits, radii, ranges.
    cell : (K, d) [m].
    weight : (J, K) gamma.
    position, velocity : (m, d) [m], [m/s].
    start_time : mission time of sample 0 [s].
    period : T_s [s].
    start_free : whether plans may start elsewhere; `position` is then a hint.
    end : at "rest" anywhere, "free", "fixed" (at rest at `goal`), or "closed" (in the state of the start).
    goal : (m, d) [m], for a fixed end.
    """

    fleet: Fleet
    cell: FloatArray
    weight: FloatArray
    position: FloatArray
    velocity: FloatArray
    start_time: float
    period: float
    start_free: bool = False
    end: Literal["rest", "free", "fixed", "closed"] = "rest"
    goal: FloatArray | None = None

    def window(self, steps: int) -> Window:
        """Return the stretch of `steps` samples with the ends that are asked for."""
        ends = Ends(
            start_position=None if self.start_free else self.position,
            start_velocity=None if self.start_free else self.velocity,
            end_position=self.goal if self.end == "fixed" else None,
            end_velocity=np.zeros_like(self.velocity) if self.end in {"rest", "fixed"} else None,
            closed=self.end == "closed",
        )
        return Window(self.fleet, self.cell, self.weight, steps, self.period, ends)

    def plan(self, window: Window, x: FloatArray) -> Plan:
        """Return the plan of a decision vector."""
        position, velocity = window.motion(x)
        return Plan(self.start_time, self.period, position, velocity, np.diff(velocity, axis=0) / self.period)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A plan with what it is worth: J (4.34) [m], whether it keeps all requirements, and its guess."""

    plan: Plan
    cost: float
    feasible: bool
    kind: str

    @property
    def complete(self) -> bool:
        """Whether everything is covered, feasibly."""
        return self.feasible and self.cost == 0.0


def plan_whole(
    task: Task, backend: Backend, *, attempts: int = 6, starts: int = 3, deadline: float | None = None
) -> Candidate:
    """Return a short plan that covers everything owed, or the best one found; anytime.

    Starts from sweeps and a tour, tells them apart by a few coarse stages, refines the best, and then
    shortens what covers everything or lengthens what does not. What is still left over is flown to at the
    end. `attempts` bounds the refinements, `deadline` is on `time.perf_counter`.
    """
    flights = [(guess, _fly(task, guess, None)) for guess in _guesses(task)]
    least = int(np.ceil(_stopping_time(task) / task.period)) + 1
    steps = max(least, round(COMPRESSION * min(flight.steps for _, flight in flights)))
    found: list[Candidate] = [_as_flown(task, *flight) for flight in flights]
    found.append(_as_flown(task, rest := rest_guess(task.position), _fly(task, rest, least)))
    tried: dict[int, bool] = {}
    while len(tried) < attempts and steps not in tried and not _late(deadline):
        candidate = plan_for(task, backend, steps, starts=starts, deadline=deadline)
        found.append(candidate)
        tried[steps] = candidate.complete
        if not candidate.complete and any(tried.values()):
            break
        left = _owed_after(task, candidate.plan).mean()
        steps = max(least, steps - 1) if candidate.complete else steps + max(1, round(np.clip(left, 0.05, 0.3) * steps))
    found.sort(key=_rank)
    finished = [_extended(task, candidate, backend, deadline) for candidate in found[:_FINALISTS] if candidate.feasible]
    return min([*finished, *found], key=_rank)


def _extended(task: Task, candidate: Candidate, backend: Backend, deadline: float | None) -> Candidate:
    """Fly on to what the candidate leaves over, from its end at rest."""
    for _ in range(_EXTENSIONS):
        weight = _owed_after(task, candidate.plan)
        if not (weight > 0.0).any():
            break
        end = candidate.plan
        rest = Task(task.fleet, task.cell, weight, end.position[-1], end.velocity[-1], end.end_time, task.period)
        tour = tour_guess(rest.fleet, rest.cell, rest.weight, rest.position)
        flight = _fly(rest, tour, None)
        more = _as_flown(rest, tour, flight)
        if not more.feasible and not _late(deadline):
            more = plan_for(rest, backend, flight.steps, starts=1, deadline=deadline)
        if not more.feasible or more.plan.steps == 0:
            break
        candidate = _joined(task, candidate, more)
    return candidate


def _joined(task: Task, first: Candidate, second: Candidate) -> Candidate:
    velocity = np.concatenate([first.plan.velocity, second.plan.velocity[1:]])
    window = task.window(velocity.shape[0] - 1)
    judged = judge(window, window.decision(first.plan.position[0], velocity))
    return Candidate(task.plan(window, judged.x), judged.cost, judged.feasible, f"{first.kind}, then {second.kind}")


def _owed_after(task: Task, plan: Plan) -> FloatArray:
    """Return the weights (J, K) of what a plan's samples leave over."""
    weight = task.weight
    for position in plan.position:
        weight = np.where(measured(position, task.cell, task.fleet.radius), 0.0, weight)
    return weight


def plan_for(task: Task, backend: Backend, steps: int, *, starts: int = 3, deadline: float | None = None) -> Candidate:
    """Return the best plan of exactly `steps` samples from several starts; anytime."""
    window = task.window(steps)
    flown = [(guess.kind, window.exact_ends(_fly(task, guess, steps).decision)) for guess in _guesses(task)]
    flown.sort(key=lambda item: judge(window, item[1]).cost)
    still = _fly(task, rest_guess(task.position), steps)
    tried: list[tuple[str, Refined]] = [("rest", judge(window, window.exact_ends(still.decision)))]
    for kind, x in flown[:starts]:
        if _late(deadline):
            break
        tried.append((kind, refine(window, x, backend, sharpness=COARSE, iterations=4, deadline=deadline)))
    tried.sort(key=lambda item: (not item[1].feasible, item[1].cost))
    kind, best = tried[0]
    if not (best.feasible and best.cost == 0.0) and not _late(deadline):
        finer = refine(window, best.x, backend, sharpness=SHARPNESS[2:], iterations=8, region=0.5, deadline=deadline)
        if finer.feasible >= best.feasible and finer.cost < best.cost:
            best = finer
    return Candidate(task.plan(window, best.x), best.cost, best.feasible, kind)


def _guesses(task: Task) -> list[Guess]:
    if not (task.weight > 0.0).any():
        return [rest_guess(task.position)]
    tour = tour_guess(task.fleet, task.cell, task.weight, task.position)
    return [*sweep_guesses(task.fleet, task.cell, task.weight, task.position, task.period), tour]


def _fly(task: Task, guess: Guess, steps: int | None) -> Motion:
    """Fly a guess from the start, or from where it begins if that is free, to the end that is asked for."""
    position, velocity, paths = task.position, task.velocity, guess.paths
    if task.start_free:
        position = np.array([path[0] for path in paths])
    if task.end in {"fixed", "closed"}:
        home = position if task.goal is None else task.goal
        paths = [np.concatenate([path, goal[None]]) for path, goal in zip(paths, home, strict=True)]
    stop = task.end != "free"
    return follow(paths, position, velocity, task.fleet, task.period, steps=steps, stop=stop)


def _as_flown(task: Task, guess: Guess, flight: Motion) -> Candidate:
    window = task.window(flight.steps)
    judged = judge(window, flight.decision)
    return Candidate(task.plan(window, flight.decision), judged.cost, judged.feasible, guess.kind)


def _stopping_time(task: Task) -> float:
    speed = np.linalg.norm(task.velocity, axis=1)
    return float((speed / task.fleet.input_max).max()) + task.period


def _rank(candidate: Candidate) -> tuple[bool, bool, int, float]:
    """Feasible before complete before short; what is incomplete, by what it leaves."""
    short = candidate.plan.steps if candidate.complete else 0
    return (not candidate.feasible, candidate.cost > 0.0, short, candidate.cost)


def _late(deadline: float | None) -> bool:
    return deadline is not None and time.perf_counter() >= deadline
