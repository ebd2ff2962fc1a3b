"""Plans of large fleets, refined by blocks of few agents."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from flights import fleet_of
from motions import PERIOD, UNLIMITED, grid

from mpc_cover.planning.block_refinement import blocks_of, plan_by_blocks
from mpc_cover.planning.budget import Budget
from mpc_cover.planning.task import End, Task
from solvers.backends.registry import make_backend


def spread(side: int) -> Task:
    """`side` squared agents in the middles of squares of 5 m."""
    start = 5.0 * grid(side)
    room = np.full(2, 5.0 * side)
    limits = np.full(side**2, 1.5)
    fleet = fleet_of(
        start,
        motion_min=np.zeros(2),
        motion_max=room,
        communication_range=8.0,
        speed_max=limits,
        input_max=limits,
        radius=np.ones((side**2, 1)),
        separation_min=0.5,
    )
    cell = grid(5 * side)
    return Task(fleet, cell, np.ones((1, len(cell))), start, np.zeros_like(start), 0.0, PERIOD)


@pytest.mark.parametrize("agents", [1, 3, 10, 25, 96])
def test_blocks_are_small_and_hold_each_agent_once(agents):
    position = np.random.default_rng(agents).uniform(size=(agents, 2))
    blocks = blocks_of(position)
    assert sorted(np.concatenate(blocks).tolist()) == list(range(agents))
    assert max(len(block) for block in blocks) <= 3


@pytest.mark.parametrize("side", [3, 5])
def test_a_large_fleet_takes_little_longer_than_its_swaths(side):
    """A square of 5 m is swept at 1.5 m/s by a disc of 1 m in (25 - pi) / 3 s at least."""
    task = spread(side)
    found = plan_by_blocks(task, make_backend("native"), UNLIMITED)
    assert found is not None
    assert found.complete
    assert not task.remaining_after(found.plan).any()
    assert found.plan.steps * PERIOD <= 1.6 * (25.0 - np.pi) / 3.0


def test_counted_work_makes_plans_the_same():
    task = spread(3)
    one, two = (plan_by_blocks(task, make_backend("native"), Budget.counted(0.5)) for _ in range(2))
    assert one is not None
    assert two is not None
    assert np.array_equal(one.plan.position, two.plan.position)


def test_an_exhausted_budget_ends_the_search_at_once():
    task, before = spread(5), time.process_time()
    plan_by_blocks(task, make_backend("native"), Budget.counted(0.0))
    assert time.process_time() - before < 1.0


def test_what_blocks_cannot_keep_is_left_to_others():
    task = spread(3)
    assert plan_by_blocks(replace(task, end=End.FREE), make_backend("native"), UNLIMITED) is None
    assert plan_by_blocks(replace(task, start_free=True), make_backend("native"), UNLIMITED) is None
