"""Cells that are left are inserted into paths where that costs least."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from flights import fleet_of

from mpc_cover.planning.initial_guess.cell_insertion import with_cells
from mpc_cover.planning.initial_guess.path_geometry import leg_distance, path_length

LINE = np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 0.0], [30.0, 0.0]])
START = np.array([[0.0, 0.0], [0.0, 20.0]])
PATHS = [LINE, np.array([[0.0, 20.0], [30.0, 20.0]])]


def nearest(path, cell):
    return min(leg_distance(cell[None], a, b)[0][0] for a, b in pairwise(path))


def test_a_cell_beside_a_path_costs_a_detour_and_no_way_back():
    cell = np.array([[12.0, 2.0]])
    one, two = with_cells(PATHS, cell, np.ones((1, 1)), fleet_of(START), 0.5)
    assert two.tolist() == PATHS[1].tolist()
    assert nearest(one, cell[0]) == pytest.approx(0.5)
    assert path_length(one) - path_length(LINE) < 1.0


def test_whoever_ends_early_takes_it():
    cell = np.array([[15.0, 10.0]])
    one, two = with_cells([LINE, PATHS[1][:1]], cell, np.ones((1, 1)), fleet_of(START), 0.0)
    assert one.tolist() == LINE.tolist()
    assert two[-1] == pytest.approx([15.0, 10.0])


def test_only_those_that_can_measure_are_sent():
    cell = np.array([[12.0, 2.0], [12.0, 3.0]])
    fleet = fleet_of(START, radius=np.array([[-np.inf], [1.0]]))
    one, two = with_cells(PATHS, cell, np.ones((1, 2)), fleet, 0.0)
    assert one.tolist() == LINE.tolist()
    assert [nearest(two, each) for each in cell] == pytest.approx([0.0, 0.0])
    nobody = fleet_of(START, radius=np.full((2, 1), -np.inf))
    assert with_cells(PATHS, cell, np.ones((1, 2)), nobody, 0.0) is None


def test_nothing_left_changes_nothing_and_much_left_is_no_detour():
    cell = np.random.default_rng(0).uniform(0.0, 30.0, (400, 2))
    unchanged = with_cells(PATHS, cell, np.zeros((1, 400)), fleet_of(START), 0.5)
    assert [path.tolist() for path in unchanged] == [path.tolist() for path in PATHS]
    assert with_cells(PATHS, cell, np.ones((1, 400)), fleet_of(START), 0.5) is None
