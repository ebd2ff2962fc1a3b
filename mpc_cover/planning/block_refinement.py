"""Refinement of a large fleet's plan by blocks of few neighbouring agents, whose cost does not grow with the fleet.

A block is planned over the whole horizon while all others keep their motions: it has to cover only what they do not.
The whole plan counts only if it satisfies all requirements. Paths are flown in fewer steps, then repaired block by
block; the length is bisected.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

from mpc_cover.constraints.boundary import BoundaryConditions
from mpc_cover.coverage.nearest import remaining_weight
from mpc_cover.model.fleet_constraints import FleetConstraints
from mpc_cover.model.look_instants import InterSample
from mpc_cover.planning.budget import GUESS_SAMPLE_S
from mpc_cover.planning.candidate import evaluate_guess, evaluate_motion, guess_priority
from mpc_cover.planning.initial_guess.partition import PartSweeps
from mpc_cover.planning.ocp import OCP
from mpc_cover.planning.scp import REFINEMENT_REGION, optimise
from mpc_cover.planning.segment_refinement import flown_in_steps
from mpc_cover.planning.task import End

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.candidate import Candidate
    from mpc_cover.planning.task import Task
    from solvers.backends.base import Backend

_BLOCK = 3
"""Agents of a block; a plain choice: the thesis' reference case has as many."""
_SHARPNESS = (10.0, 30.0, 100.0)
"""Sharpness of the soft minimum by stage (see `scp.SHARPNESS`); a plain choice, as the paths are good already."""
_ITERATIONS = 10
"""Newton steps or QPs per stage; a plain choice."""
_REACH = 2.0
"""Distance from a block's paths within which it covers cells, in sensing radii; a plain choice."""
_SHORTEST = 0.5
"""Part of a guess's length from which on lengths are bisected; a plain choice."""
_PASSES, _TRIED = 2, 6
"""Passes over all blocks at each length, and guesses that are tried; plain choices."""
_VIOLATION_COST = 2.0
"""Relative increase of a guess's length per sensing radius of violation where they are ordered; a plain choice."""


def blocks_of(position: FloatArray) -> list[IntArray]:
    """Return the agents at (m, d) positions [m] in blocks of neighbours, of at most `_BLOCK`, halved until so small."""
    found, waiting = [], [np.arange(len(position))]
    while waiting:
        agents = waiting.pop()
        if len(agents) <= _BLOCK:
            found.append(np.sort(agents))
            continue
        axis = int(np.argmax(np.ptp(position[agents], axis=0)))
        order = agents[np.argsort(position[agents, axis], kind="stable")]
        half = _BLOCK * max(1, round(len(order) / _BLOCK / 2))
        waiting += [order[:half], order[half:]]
    return found


def plan_by_blocks(task: Task, backend: Backend, budget: Budget) -> Candidate | None:
    """Return the shortest complete plan found from sweeps of parts; None where there is none, or no task for one.

    Anytime. Guesses after the first are tried at once at a shorter length than that of the best plan so far.
    """
    if task.looks is not None or task.end is not End.REST or task.start_free or task.fleet.lost:
        return None
    guesses: list[Candidate] = []
    for guess in PartSweeps().guesses(task):
        if guesses and budget.exhausted:
            break
        guesses.append(evaluate_guess(task, guess))
        budget.charge(GUESS_SAMPLE_S * guesses[-1].plan.steps)
    guesses.sort(key=lambda one: guess_priority(one, _VIOLATION_COST / task.fleet.sensing_radius_min))
    best: Candidate | None = None
    for candidate in guesses[:_TRIED]:
        best = _shortened(task, candidate, best, backend, budget)
    return best


def _shortened(
    task: Task, guess: Candidate, best: Candidate | None, backend: Backend, budget: Budget
) -> Candidate | None:
    """Return the shortest complete plan along a guess's paths if it is shorter than `best`, else that."""
    if guess.complete and (best is None or guess.plan.steps < best.plan.steps):
        best = guess
    along, most = guess, guess.plan.steps if best is None else best.plan.steps - 1
    low, steps = max(task.least_steps, int(_SHORTEST * guess.plan.steps)), most
    while low <= most and not budget.exhausted:
        tried = _repaired(task, along, steps, backend, budget)
        if tried.complete:
            along = best = tried
            most = steps - 1
        elif steps == most and along is guess:
            break
        else:
            low = steps + 1
        steps = (low + most) // 2
    return best


def _repaired(task: Task, plan: Candidate, steps: int, backend: Backend, budget: Budget) -> Candidate:
    """Return a plan's paths flown in so many steps, after descents of each block."""
    ocp = task.ocp(steps)
    position, velocity = ocp.motion(flown_in_steps(ocp, task.position[None], plan.plan.velocity))
    found = evaluate_motion(task, position[0], velocity, plan.origin)
    for _ in range(_PASSES):
        if found.complete or budget.exhausted:
            break
        for block in blocks_of(task.position):
            part = _block_ocp(task, position, velocity, block)
            x = part.decision(position[0, block], velocity[:, block])
            result = optimise(
                part, x, backend, sharpness=_SHARPNESS, iterations=_ITERATIONS, region=REFINEMENT_REGION, budget=budget
            )
            position, velocity = position.copy(), velocity.copy()
            position[:, block], velocity[:, block] = part.motion(result.x)
        found = evaluate_motion(task, position[0], velocity, plan.origin)
        budget.charge(GUESS_SAMPLE_S * steps)
    return found


def _block_ocp(task: Task, position: FloatArray, velocity: FloatArray, block: IntArray) -> OCP:
    """Return the OCP of a block: its own distances, and the cells near its paths that no other agent covers."""
    fleet, steps = task.fleet, len(position) - 1
    others = np.setdiff1d(np.arange(fleet.size), block)
    between = InterSample(velocity[:, others], task.period, fleet.look_instants)
    left = remaining_weight(position[:, others], task.cell, fleet.radius[others], task.weight, between)
    paths = position[:, block].reshape(-1, fleet.dimension)
    demanded = np.flatnonzero((left > 0.0).any(axis=0))
    distance, _ = scipy.spatial.cKDTree(paths).query(task.cell[demanded])
    near = demanded[distance <= _REACH * fleet.sensing_radius_min]
    own = FleetConstraints.of(
        fleet,
        ids=tuple(fleet.ids[i] for i in block),
        start=fleet.start[block],
        input_max=fleet.input_max[block],
        speed_max=fleet.speed_max[block],
        radius=fleet.radius[block],
        communication_range=np.inf,
        links=(),
        lost=(),
        pair_separation={},
    )
    ends = BoundaryConditions(position[0, block], velocity[0, block], None, np.zeros_like(velocity[0, block]))
    return OCP(own, task.cell[near], left[:, near], steps, task.period, ends, None)
