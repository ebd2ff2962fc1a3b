"""Plans from rest: a descent that begins softly enough shares the cells out among the agents by itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.planning.basin_hopping import Pool, hop, left_over
from mpc_cover.planning.candidate import Candidate, candidate_of
from mpc_cover.planning.initial_guess.guess import GuessKind, Origin, rest_guess
from mpc_cover.planning.scp import SOFT_SHARPNESS, descends_natively, optimise
from mpc_cover.planning.segment_refinement import flown_in_steps

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.ocp import OCP
    from mpc_cover.planning.scp import SCPResult
    from mpc_cover.planning.task import Task
    from solvers.backends.base import Backend

MANY = 16
"""Agents from which on plans from rest are made shorter instead of comparing them with guesses, which take long to make
and are worse; a plain choice: guesses for twenty agents take seconds."""
_FIRST_STEPS = 16
"""First length that is tried; a plain choice."""
_HOPS, _LEFT, _GAP = 4, 0.03, 0.06
"""Hops for each length; the part of the demand up to which the best motion may leave some for them; and the relative
gap between the shortest sufficient length and the longest insufficient one that is not bisected. Plain choices."""


def plan_from_rest(task: Task, backend: Backend, budget: Budget) -> Candidate | None:
    """Return a short complete plan that spreads the fleet from where it stands, or None.

    Only where the library descends: softly enough, a descent from rest shares the cells out among the agents by itself.
    The lengths are bisected; each begins from rest, and then from the shortest plan so far, flown faster.
    """
    steps, too_short, best = max(_FIRST_STEPS, task.least_steps), task.least_steps - 1, None
    resting = rest_guess(task.position)
    origin = Origin(GuessKind.GIVEN, "spread from rest")
    while not budget.exhausted:
        ocp = task.ocp(steps)
        if not descends_natively(ocp, backend):
            break
        starts = [ocp.decision_of(task.flown(resting, steps))]
        if best is not None:
            starts.append(flown_in_steps(ocp, best.plan.position, best.plan.velocity))
        if (found := _covered(ocp, starts, backend, budget)) is not None:
            best = candidate_of(task, steps, found, origin)
        if best is None or best.plan.steps != steps:
            too_short = steps
        steps = 2 * steps if best is None else (too_short + best.plan.steps) // 2
        if best is not None and best.plan.steps - too_short <= max(1.0, _GAP * best.plan.steps):
            break
    return best


def _covered(ocp: OCP, starts: list[FloatArray], backend: Backend, budget: Budget) -> SCPResult | None:
    """Return the first complete motion that descents from some starts, and a few hops from there, find; or None."""
    pool, rng = Pool(ocp), np.random.default_rng(0)
    for x in starts:
        found = optimise(ocp, x, backend, sharpness=SOFT_SHARPNESS, budget=budget)
        if found.complete:
            return found
        pool.add(found)
    few = np.count_nonzero(left_over(ocp, pool.best.x)) <= _LEFT * np.count_nonzero(ocp.weight)
    for _ in range(_HOPS if few else 0):
        if budget.exhausted:
            break
        found = hop(ocp, pool.drawn(rng), backend, rng, budget=budget)
        if found.complete:
            return found
        pool.add(found)
    return None
