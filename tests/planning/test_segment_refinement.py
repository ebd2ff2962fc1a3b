"""Shortening a plan stretch by stretch."""

from __future__ import annotations

import numpy as np
import pytest
from flights import fleet_of
from motions import PERIOD, UNLIMITED

from mpc_cover.model.motion import roll_out
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.segment_refinement import refine_segments, resampled
from mpc_cover.planning.task import Task
from solvers.backends.registry import make_backend


def test_resampling_plays_the_same_path_faster():
    velocity = np.zeros((11, 1, 2))
    velocity[1:-1, 0, 0] = 1.0
    faster = resampled(velocity, 8)
    assert faster.shape == (9, 1, 2)
    assert faster[:, 0, 0].sum() == pytest.approx(velocity[:, 0, 0].sum(), rel=0.05)
    assert faster[-1].tolist() == [[0.0, 0.0]]


def test_what_a_plan_covers_only_at_its_end_is_still_covered_when_it_is_shortened():
    """The end of the last segment is free: what was measured there alone is demanded of the segment."""
    start = np.array([[0.5, 0.5], [1.55, 0.5]])
    fleet = fleet_of(start, motion_min=np.zeros(2), motion_max=np.array([8.0, 2.0]))
    cell = np.array([[1.0, 0.5], [4.0, 0.5], [7.9, 0.5]])
    task = Task(fleet, cell, np.ones((1, 3)), start, np.zeros_like(start), 0.0, PERIOD)
    velocity = np.zeros((21, 2, 2))
    velocity[1:-1, :, 0] = np.minimum(0.65, np.arange(1, 20)[::-1] * 0.3)[:, None]
    velocity[1, :, 0] = 0.3
    motion = roll_out(start, velocity[0], np.diff(velocity, axis=0) / PERIOD, PERIOD)[0], velocity
    assert not task.remaining_after(Trajectory.even(0.0, PERIOD, *motion, np.diff(velocity, axis=0) / PERIOD)).any()
    position, faster = refine_segments(task, motion, make_backend("piqp"), length=12, passes=2, budget=UNLIMITED)
    assert len(faster) < len(velocity)
    shorter = Trajectory.even(0.0, PERIOD, position, faster, np.diff(faster, axis=0) / PERIOD)
    assert not task.remaining_after(shorter).any()
