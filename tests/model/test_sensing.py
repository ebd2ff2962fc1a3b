"""Disc sensing against analytical truths."""

from __future__ import annotations

import numpy as np

from mpc_cover.model import sensing
from mpc_cover.model.sensing import covered_at, look_counts, measured


def test_a_cell_exactly_at_the_radius_is_measured_and_one_beyond_is_not():
    cell = np.array([[0.3 + 0.6, 0.0], [0.91, 0.0]])
    assert measured(np.array([[0.3, 0.0]]), cell, np.array([[0.6]])).tolist() == [[True, False]]


def test_only_agents_that_can_measure_a_magnitude_do():
    seen = measured(np.zeros((2, 2)), np.zeros((1, 2)), np.array([[1.0, -np.inf], [-np.inf, -np.inf]]))
    assert seen.tolist() == [[True], [False]]


def test_a_lost_agent_sees_nothing():
    assert not measured(np.full((1, 2), np.nan), np.zeros((1, 2)), np.ones((1, 1))).any()


def test_a_cell_is_covered_when_its_last_magnitude_is():
    position = np.array([[[0.0, 0.0], [9.0, 0.0]], [[9.0, 0.0], [9.0, 0.0]], [[9.0, 0.0], [0.0, 0.0]]])
    radius = np.array([[1.0, -np.inf], [-np.inf, 1.0]])
    first = covered_at(np.array([0.0, 0.5, 1.0]), position, np.array([[0.0, 0.0], [5.0, 5.0]]), radius)
    assert first.tolist() == [1.0, np.inf]


def test_looks_count_once_a_period_for_each_agent():
    time = np.array([0.0, 0.2, 0.5, 1.0])
    here = np.zeros((4, 2, 2))
    cell, radius = np.zeros((1, 2)), np.ones((2, 1))
    assert covered_at(time, here, cell, radius, 2, 0.5).tolist() == [0.0]
    assert covered_at(time, here, cell, radius, 4, 0.5).tolist() == [0.5]
    assert covered_at(time, here, cell, radius, 6, 0.5).tolist() == [1.0]
    assert covered_at(time, here, cell, radius, 7, 0.5).tolist() == [np.inf]


def test_looks_of_a_motion_are_counted_agent_by_agent(monkeypatch):
    monkeypatch.setattr(sensing, "_PAIRS_MAX", 50)  # samples and cells in parts
    rng = np.random.default_rng(2)
    position, cell = rng.uniform(0.0, 3.0, (7, 3, 2)), rng.uniform(0.0, 3.0, (20, 2))
    radius = np.array([[1.0, -np.inf], [0.5, 2.0], [-np.inf, 1.0]])
    expected = np.zeros((2, 20), dtype=int)
    for n, i, j, k in np.ndindex(7, 3, 2, 20):
        expected[j, k] += np.linalg.norm(position[n, i] - cell[k]) <= radius[i, j]
    np.testing.assert_array_equal(look_counts(position, cell, radius), expected)
