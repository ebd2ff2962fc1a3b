"""A formation that flies its lanes has every cell within range of some agent."""

from itertools import pairwise

import numpy as np
import pytest
from motions import grid

from mpc_cover.planning.initial_guess.formation_lanes import Sensor, formation_lanes, lane_count, needed_width

WIDE = (np.full(2, -100.0), np.full(2, 100.0))
SENSOR = Sensor(1.0, 0.9)


def swept(points, shape, cell):
    """Return (K,): which cells some agent passes within a sensing radius on straight legs."""
    part = np.linspace(0.0, 1.0, 200)[:, None]
    way = np.concatenate([a + part * (b - a) for a, b in pairwise(points)])
    place = (way[:, None] + shape).reshape(-1, shape.shape[1])
    return np.linalg.norm(place[:, None] - cell, axis=2).min(axis=0) <= 1.0 + 1e-9


@pytest.mark.parametrize("along", [0, 1])
@pytest.mark.parametrize(
    "shape",
    [
        np.array([[0.0, 0.0], [1.1, 0.0], [2.2, 0.0]]),
        np.array([[0.0, 0.0], [1.1, 0.0], [0.0, 1.1], [1.1, 1.1]]),
        np.array([[0.0, 0.0], [1.0, 0.7], [2.0, 1.4], [3.0, 0.2]]),
    ],
    ids=["line", "block", "echelon"],
)
def test_everything_is_swept(shape, along):
    shape = shape - shape.mean(axis=0)
    cell = grid(16, 0.5)
    points = formation_lanes(cell, shape, along, SENSOR, WIDE, np.zeros(2))
    assert swept(points, shape, cell).all()


def test_the_nearest_corner_comes_first_and_the_centre_stays_in_its_box():
    shape = np.array([[-0.5, 0.0], [0.5, 0.0]])
    box = (np.array([0.5, 0.0]), np.array([7.5, 8.0]))
    for corner in np.array([[0.0, 0.0], [8.0, 0.0], [0.0, 8.0], [8.0, 8.0]]):
        points = formation_lanes(grid(16, 0.5), shape, 1, SENSOR, box, corner)
        assert np.linalg.norm(points[0] - corner) < 3.0
        assert ((points >= box[0] - 1e-12) & (points <= box[1] + 1e-12)).all()


def test_a_formation_that_passes_over_no_cell_has_no_lanes():
    shape = np.array([[-3.0, 0.0], [3.0, 0.0]])
    assert formation_lanes(np.zeros((1, 2)), shape, 1, SENSOR, WIDE, np.zeros(2)) is None


def test_lanes_are_no_wider_than_they_have_to_be():
    cell = grid(16, 0.5)  # rows from 0.25 to 7.75 m
    assert [lane_count(cell, width, 0, SENSOR) for width in (0.0, 2.0, 5.8, 20.0)] == [5, 2, 1, 1]
    assert needed_width(cell, 2.0, 0, SENSOR) == pytest.approx(7.5 / 2 - 1.8)
    assert needed_width(grid(2, 0.5), 9.0, 0, SENSOR) == 0.0
