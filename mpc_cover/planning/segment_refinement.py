"""Shortening a long plan stretch by stretch: small QPs whose cost does not grow with the mission.

A stretch begins and ends in the states of the plan around it and has to cover only what nothing else in the
plan covers. Asked for the same in one sample less, it takes a sample off the whole plan.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.boundary import BoundaryConditions
from mpc_cover.coverage.nearest import remaining_weight
from mpc_cover.model.sensing import look_counts
from mpc_cover.planning.ocp import OCP
from mpc_cover.planning.scp import evaluate, optimise
from mpc_cover.planning.task import multi_look_options

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.scp import SCPResult
    from mpc_cover.planning.task import Task
    from solvers.backends.base import Backend

_STAGES = (20.0, 40.0)
_ITERATIONS = 2


def resampled(velocity: FloatArray, steps: int) -> FloatArray:
    """Return a motion's velocities (N+1, m, d) [m/s] played in `steps` samples: faster along the same path."""
    old = velocity.shape[0] - 1
    place = np.linspace(0.0, old, steps + 1)
    low = np.minimum(place.astype(int), old - 1)
    part = (place - low)[:, None, None]
    between = (1.0 - part) * velocity[low] + part * velocity[low + 1]
    scaled = between * (old / steps)
    scaled[0], scaled[-1] = velocity[0], velocity[-1]
    return np.asarray(scaled)


def refine_segments(
    task: Task,
    motion: tuple[FloatArray, FloatArray],
    backend: Backend,
    *,
    length: int,
    passes: int,
    budget: Budget,
    on_progress: Callable[[int], None] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return a motion (positions [m], velocities [m/s]) that covers no less, repaired and shortened where it can be.

    Stretches of `length` samples are taken one after another, each beginning in the middle of the one before,
    `passes` times or until a pass gains nothing. `on_progress` hears of the
    length after each stretch.
    """
    position, velocity = motion
    for _ in range(passes):
        before, begin = velocity.shape[0], 0
        while begin < velocity.shape[0] - 2:
            if budget.exhausted:
                return position, velocity
            end = min(begin + length, velocity.shape[0] - 1)
            position, velocity = _stretch(task, (position, velocity), backend, begin, end, budget)
            begin += length // 2
            if on_progress is not None:
                on_progress(velocity.shape[0] - 1)
        if velocity.shape[0] == before:
            break
    return position, velocity


def _stretch(
    task: Task, motion: tuple[FloatArray, FloatArray], backend: Backend, begin: int, end: int, budget: Budget
) -> tuple[FloatArray, FloatArray]:
    """Replace samples `begin` to `end` by better ones, or by themselves.

    One less if that covers as much, else as many or one more that cover more or violate less.
    """
    position, velocity = motion
    owed = _left_by_others(task, position, begin, end)
    steps = end - begin
    ocp = _ocp(task, motion, owed, begin, end, steps)
    now = evaluate(ocp, ocp.decision(position[begin], velocity[begin : end + 1]))
    for count in (steps - 1,) if now.complete else (steps, steps + 1):
        ocp = _ocp(task, motion, owed, begin, end, count)
        x = ocp.exact_ends(ocp.decision(position[begin], resampled(velocity[begin : end + 1], count)))
        found = optimise(
            ocp, x, backend, sharpness=_STAGES, iterations=_ITERATIONS, budget=budget, **multi_look_options(task.looks)
        )
        if _better(found, now, longer=count > steps):
            joined = np.concatenate([velocity[:begin], ocp.motion(found.x)[1], velocity[end + 1 :]])
            whole = task.ocp(joined.shape[0] - 1)
            return whole.motion(whole.decision(position[0], joined))
    return motion


def _better(new: SCPResult, old: SCPResult, *, longer: bool) -> bool:
    """Feasible before complete before cheaper; a longer stretch must be worth its sample."""
    if not new.feasible:
        return not old.feasible and new.violation < 0.8 * old.violation
    if not old.feasible or new.complete:
        return True
    return not longer and new.merit < old.merit


def _ocp(
    task: Task,
    motion: tuple[FloatArray, FloatArray],
    owed: tuple[FloatArray, IntArray | None],
    begin: int,
    end: int,
    steps: int,
) -> OCP:
    (position, velocity), (weight, looks) = motion, owed
    last = end == velocity.shape[0] - 1
    ends = BoundaryConditions(position[begin], velocity[begin], None if last else position[end], velocity[end])
    return OCP(task.fleet, task.cell, weight, steps, task.period, ends, looks)


def _left_by_others(task: Task, position: FloatArray, begin: int, end: int) -> tuple[FloatArray, IntArray | None]:
    """Return weights and looks (J, K) of what only the samples inside a stretch bring, or nothing does."""
    others = np.concatenate([position[: begin + 1], position[end:]])
    if task.looks is None:
        return remaining_weight(others, task.cell, task.fleet.radius, task.weight), None
    looks = np.maximum(task.looks - look_counts(others, task.cell, task.fleet.radius), 0)
    return np.where(looks > 0, task.weight, 0.0), looks
