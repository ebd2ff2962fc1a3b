"""The bound on outstanding work: swaths side by side, or the way to the farthest cell."""

import numpy as np
import pytest
from flights import fleet_of

from mpc_cover.control.work_estimate import work_bound

CELLS = np.stack(np.meshgrid(np.arange(20.0), np.arange(20.0)), axis=2).reshape(-1, 2)


def bound(fleet, weight, looks=None):
    return work_bound(fleet, CELLS, 1.0, (weight, looks), fleet.start)


def test_many_cells_take_their_area_over_the_rate_of_the_swaths():
    fleet = fleet_of(np.array([[5.0, 5.0], [15.0, 15.0]]))
    assert bound(fleet, np.ones((1, 400))) == pytest.approx(400 / (2 * 2.0 * 1.5))
    slower = fleet_of(fleet.start, speed_max=np.array([1.5, 0.5]))
    assert bound(slower, np.ones((1, 400))) == pytest.approx(400 / (2.0 * 2.0))
    assert bound(fleet, np.ones((1, 400)), np.full((1, 400), 2)) == pytest.approx(800 / 6.0)


def test_a_far_cell_takes_the_way_to_it():
    fleet = fleet_of(np.array([[0.0, 0.0], [0.0, 1.0]]))
    weight = np.zeros((1, 400))
    weight[0, np.flatnonzero((CELLS == [19.0, 0.0]).all(axis=1))] = 1.0
    assert bound(fleet, weight) == pytest.approx(18.0 / 1.5)
    assert bound(fleet, 0.0 * weight) == 0.0
