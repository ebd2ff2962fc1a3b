"""What a plan leaves over when several looks are owed."""

from __future__ import annotations

import numpy as np
from mission_kinds import mission_with

from mpc_cover.model.sensing import look_counts
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.task import Task, needs_laps


def test_a_cell_is_left_over_until_all_its_looks_are_taken():
    mission = mission_with(None, radius=1.2)
    fleet, field = mission.fleet, mission.field
    looks = np.arange(field.size)[None] % 5 + 1
    weight = np.full((1, field.size), 2.0)
    still = (fleet.start, np.zeros_like(fleet.start), 0.0, 0.5)
    task = Task(fleet, field.cell, weight, *still, looks=looks)
    plan = Trajectory.at_rest(fleet.start, 0.0, 0.5, 2)  # three samples
    near = look_counts(fleet.start[None], field.cell, fleet.radius)
    left = task.remaining_after(plan)
    np.testing.assert_array_equal(left, np.where(3 * near >= looks, 0.0, 2.0))
    assert (left[near > 0] > 0.0).any()
    assert (left == 0.0).any()


def test_few_looks_take_no_laps():
    assert not needs_laps(None)
    assert not needs_laps(np.array([[3, 0, 1]]))
    assert needs_laps(np.array([[0, 4]]))
