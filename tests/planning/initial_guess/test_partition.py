"""Sweeps of a part of the demand for each agent."""

from __future__ import annotations

import numpy as np
from flights import fleet_of
from motions import PERIOD, grid

from mpc_cover.planning.initial_guess.partition import AGENTS_MIN, PartSweeps, bisected
from mpc_cover.planning.task import Task


def task_of(agents: int) -> Task:
    start = 5.0 * grid(4)[:agents]
    fleet = fleet_of(start, motion_min=np.zeros(2), motion_max=np.full(2, 20.0), communication_range=8.0)
    cell = grid(20)
    return Task(fleet, cell, np.ones((1, len(cell))), start, np.zeros_like(start), 0.0, PERIOD)


def test_parts_hold_each_cell_once_in_proportion_to_the_shares():
    rng = np.random.default_rng(3)
    start, cell = rng.uniform(0.0, 10.0, (11, 2)), rng.uniform(0.0, 10.0, (700, 2))
    share = rng.uniform(0.5, 2.0, 11)
    parts = bisected(start, share, cell)
    assert sorted(np.concatenate(parts).tolist()) == list(range(700))
    assert np.abs([len(part) for part in parts] - 700.0 * share / share.sum()).max() < 4.0


def test_agents_spread_over_a_square_keep_to_their_quarters():
    start, cell = 5.0 * grid(4), grid(20)
    for here, part in zip(start, bisected(start, np.ones(16), cell), strict=True):
        assert np.abs(cell[part] - here).max() <= 2.0 + 1e-9


def test_one_place_for_all_is_no_obstacle():
    parts = bisected(np.zeros((9, 2)), np.ones(9), grid(6))
    assert {len(part) for part in parts} == {4}


def test_parts_swept_at_the_same_time_keep_the_links_of_the_start():
    task = task_of(16)
    together = [guess.motion for guess in PartSweeps().guesses(task) if guess.motion is not None]
    assert together
    for motion in together:
        assert np.allclose(np.ptp(motion.position - task.position, axis=1), 0.0)


def test_small_fleets_are_planned_as_a_whole():
    assert not list(PartSweeps().guesses(task_of(AGENTS_MIN - 1)))
