"""A plan with something left is extended to it, however far, at full speed, and whatever time is left to plan."""

from dataclasses import replace

import numpy as np
import pytest
from flights import fleet_of

from mpc_cover.planning.budget import Budget
from mpc_cover.planning.candidate import evaluate_guess
from mpc_cover.planning.extension import extended
from mpc_cover.planning.initial_guess.guess import GuessKind, rest_guess
from mpc_cover.planning.initial_guess.staggered_tour import StaggeredTour
from mpc_cover.planning.task import Task
from solvers.backends.registry import make_backend

PERIOD, SPEED = 0.5, 1.5


def far_task(cell, start, **fleet):
    """Return the task of covering cells (K, 2) [m] from rest at (m, 2) [m] on a wide plain."""
    position = np.array(start, dtype=float)
    wide = {"motion_min": np.full(2, -5000.0), "motion_max": np.full(2, 5000.0), **fleet}
    limits = fleet_of(position, **wide)
    cells = np.array(cell, dtype=float)
    return Task(limits, cells, np.ones((1, len(cells))), position, 0.0 * position, 0.0, PERIOD)


def from_rest(task, budget):
    resting = evaluate_guess(task, rest_guess(task.position), task.least_steps)
    return extended(task, resting, make_backend("piqp"), budget)


@pytest.mark.parametrize("distance", [30.0, 300.0, 3000.0])
@pytest.mark.parametrize("reach", [np.inf, 2.0])
def test_there_is_a_plan_that_gets_there_at_cruise_speed(distance, reach):
    task = far_task([[distance, 0.0]], [[0, 0], [1, 1]], separation_min=0.5, communication_range=reach)
    plan = from_rest(task, Budget.counted(0.0))
    assert plan.complete
    assert plan.kind is not GuessKind.REST
    assert plan.plan.steps * PERIOD < 1.1 * distance / SPEED + 8.0


def test_a_fleet_in_flight_does_not_plan_beyond_its_budget():
    task = far_task([[30.0, 0.0]], [[0, 0]])
    moving = replace(task, velocity=np.array([[0.5, 0.0]]))
    assert not from_rest(moving, Budget.counted(0.0)).covers
    assert from_rest(moving, Budget.counted(1.0)).covers


def test_agents_whose_ways_cross_set_out_one_after_another():
    start, cell = [[0, 0], [0, 3], [3, 0]], [[40, 3], [40, 0], [3, 40], [-20, 1]]
    task = far_task(cell, start, separation_min=2.0)
    guess = next(StaggeredTour(Budget.unlimited()).guesses(task))
    found = evaluate_guess(task, guess)
    assert found.covers
    between = guess.motion.position[:, :, None] - guess.motion.position[:, None]
    assert (np.linalg.norm(between, axis=3) + 9.0 * np.eye(3)).min() >= 2.0


def test_what_the_extension_is_for_stays_apart_from_the_plan_itself():
    task = far_task([[20.0, 0.0]], [[0, 0]])
    near = replace(task, weight=0.0 * task.weight)
    first = evaluate_guess(near, rest_guess(task.position), 4)
    whole = extended(
        task,
        replace(first, origin=first.origin._replace(kind=GuessKind.TOUR)),
        make_backend("piqp"),
        Budget.unlimited(),
    )
    assert whole.covers
    assert whole.main is first.plan
