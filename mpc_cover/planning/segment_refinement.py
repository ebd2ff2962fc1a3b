"""Segment-wise refinement of a long plan by small QPs, whose cost does not grow with the length of the mission.

A segment begins and ends in the states of the plan around it and has to cover only what the rest of the plan does not.
If the same is possible in one sample less, the whole plan becomes a sample shorter.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.boundary import BoundaryConditions
from mpc_cover.coverage.nearest import remaining_weight
from mpc_cover.model.look_instants import InterSample
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

SEGMENT_STEPS = 24
"""Steps of a segment where a whole plan is refined; a plain choice."""
_SHARPNESS = (20.0, 40.0)
"""Sharpness of the soft minimum by stage (see `scp.SHARPNESS`): motions are good already. Plain choice."""
_ITERATIONS = 2
"""QPs per stage; a plain choice."""
_LESS_VIOLATION = 0.8
"""Part of the violation to which a segment that stays infeasible must reduce it to be accepted; a plain choice."""


def resampled(velocity: FloatArray, steps: int) -> FloatArray:
    """Return velocities (steps+1, m, d) [m/s] along the path of velocities (N+1, m, d) [m/s] in `steps` steps.

    Speeds scale by N / steps, but for the first and the last velocity.
    """
    old = velocity.shape[0] - 1
    place = np.linspace(0.0, old, steps + 1)
    low = np.minimum(place.astype(int), old - 1)
    part = (place - low)[:, None, None]
    between = (1.0 - part) * velocity[low] + part * velocity[low + 1]
    scaled = between * (old / steps)
    scaled[0], scaled[-1] = velocity[0], velocity[-1]
    return np.asarray(scaled)


def flown_in_steps(ocp: OCP, position: FloatArray, velocity: FloatArray) -> FloatArray:
    """Return the decision vector of a motion's path, (N+1, m, d) [m], [m/s], flown in the steps of an OCP."""
    return ocp.exact_ends(ocp.decision(position[0], resampled(velocity, ocp.steps)))


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
    """Return a motion, positions [m] and velocities [m/s], that covers no less, repaired and shortened where possible.

    Segments of `length` steps are refined one after another, each beginning in the middle of the one before, in
    `passes` passes or until a pass shortens nothing. `on_progress` is called with the number of steps after each.
    """
    position, velocity = motion
    for _ in range(passes):
        before, begin = velocity.shape[0], 0
        while begin < velocity.shape[0] - 2:
            if budget.exhausted:
                return position, velocity
            end = min(begin + length, velocity.shape[0] - 1)
            position, velocity = _refined_segment(task, (position, velocity), backend, begin, end, budget)
            begin += length // 2
            if on_progress is not None:
                on_progress(velocity.shape[0] - 1)
        if velocity.shape[0] == before:
            break
    return position, velocity


def _refined_segment(
    task: Task, motion: tuple[FloatArray, FloatArray], backend: Backend, begin: int, end: int, budget: Budget
) -> tuple[FloatArray, FloatArray]:
    """Return the motion with samples `begin` to `end` replaced by a better segment, or unchanged.

    A complete segment is replaced by one a step shorter, another one by one as long or a step longer that covers more
    or violates less.
    """
    position, velocity = motion
    demand = _left_by_others(task, motion, begin, end)
    steps = end - begin
    ocp = _ocp(task, motion, demand, begin, end, steps)
    now = evaluate(ocp, ocp.decision(position[begin], velocity[begin : end + 1]))
    for count in (steps - 1,) if now.complete else (steps, steps + 1):
        ocp = _ocp(task, motion, demand, begin, end, count)
        x = flown_in_steps(ocp, position[begin:], velocity[begin : end + 1])
        found = optimise(
            ocp,
            x,
            backend,
            sharpness=_SHARPNESS,
            iterations=_ITERATIONS,
            budget=budget,
            **multi_look_options(task.looks),
        )
        if _better(found, now, longer=count > steps):
            joined = np.concatenate([velocity[:begin], ocp.motion(found.x)[1], velocity[end + 1 :]])
            whole = task.ocp(joined.shape[0] - 1)
            return whole.motion(whole.decision(position[0], joined))
    return motion


def _better(new: SCPResult, old: SCPResult, *, longer: bool) -> bool:
    """Return whether `new` is better: feasible, complete or of lower merit; merit alone justifies no longer one."""
    if not new.feasible:
        return not old.feasible and new.violation < _LESS_VIOLATION * old.violation
    if not old.feasible or new.complete:
        return True
    return not longer and new.merit < old.merit


def _ocp(
    task: Task,
    motion: tuple[FloatArray, FloatArray],
    demand: tuple[FloatArray, IntArray | None],
    begin: int,
    end: int,
    steps: int,
) -> OCP:
    """Return the OCP of the segment from `begin` to `end`, in so many steps."""
    (position, velocity), (weight, looks) = motion, demand
    last = end == velocity.shape[0] - 1
    ends = BoundaryConditions(position[begin], velocity[begin], None if last else position[end], velocity[end])
    return OCP(task.fleet, task.cell, weight, steps, task.period, ends, looks)


def _left_by_others(
    task: Task, motion: tuple[FloatArray, FloatArray], begin: int, end: int
) -> tuple[FloatArray, IntArray | None]:
    """Return weights and looks (J, K) of the demand that the motion outside the segment does not cover."""
    position, velocity = motion
    instants, cells = task.fleet.look_instants, (task.cell, task.fleet.radius)
    last = end == position.shape[0] - 1  # whose position is not given
    if task.looks is None and not instants.only_samples:
        weight = task.weight
        for part in (slice(0, begin + 1), *([] if last else [slice(end, None)])):
            weight = remaining_weight(
                position[part], *cells, weight, InterSample(velocity[part], task.period, instants)
            )
        return weight, None
    others = np.concatenate([position[: begin + 1], position[position.shape[0] if last else end :]])
    if task.looks is None:
        return remaining_weight(others, *cells, task.weight), None
    looks = np.maximum(task.looks - look_counts(others, task.cell, task.fleet.radius), 0)
    return np.where(looks > 0, task.weight, 0.0), looks
