"""One path divided among agents: all cells belong to somebody, and everybody ends at the same time."""

from __future__ import annotations

import numpy as np
import pytest

from mpc_cover.planning.initial_guess.path_division import divided, path_position
from mpc_cover.planning.initial_guess.path_geometry import path_length
from mpc_cover.planning.initial_guess.path_shortening import shortened

LINE = np.array([[0.0, 0.0], [60.0, 0.0]])
CELL = np.stack([np.linspace(0.0, 60.0, 241), np.zeros(241)], axis=1)


@pytest.mark.parametrize("speed", [(1.0, 1.0), (1.0, 3.0), (0.5, 1.0)])
def test_from_both_ends_agents_meet_when_both_are_done(speed):
    start = np.array([[0.0, 0.0], [60.0, 0.0]])
    pieces, time = divided(LINE, CELL, start, np.array(speed))
    assert time == pytest.approx(60.0 / sum(speed), rel=0.02)
    assert [path_length(piece) / one for piece, one in zip(pieces, speed, strict=True)] == pytest.approx(
        [time, time], rel=0.02
    )


def test_the_way_to_a_part_counts():
    start = np.array([[0.0, 0.0], [-20.0, 0.0]])
    pieces, time = divided(LINE, CELL, start, np.ones(2))
    assert time == pytest.approx(60.0)  # the second can spare the first nothing: whoever flies to the end takes 60 s
    start = np.array([[0.0, 0.0], [60.0, 30.0]])
    pieces, time = divided(LINE, CELL, start, np.ones(2))
    assert path_length(pieces[0]) == pytest.approx(45.0, abs=0.6)
    assert time == pytest.approx(45.0, rel=0.02)


def test_a_stretch_without_cells_is_nobodys_work():
    cell = CELL[(CELL[:, 0] <= 20.0) | (CELL[:, 0] >= 40.0)]
    pieces, time = divided(LINE, cell, np.array([[20.0, 0.0], [40.0, 0.0]]), np.ones(2))
    assert time == pytest.approx(20.0, rel=0.01)
    assert sorted(piece[0, 0] for piece in pieces) == [20.0, 40.0]


def test_ends_that_meet_are_apart():
    start = np.array([[0.0, 0.0], [60.0, 0.0]])
    pieces, _ = divided(LINE, CELL, start, np.ones(2), gap=0.5)
    assert abs(pieces[0][-1, 0] - pieces[1][-1, 0]) >= 0.5


def test_more_agents_than_work_leave_some_where_they_are():
    start = np.array([[1.0, 0.0], [9.0, 0.0], [0.0, 9.0]])
    pieces, _ = divided(np.array([[0.0, 0.0], [0.0, 0.0]]), np.zeros((1, 2)), start, np.ones(3))
    assert [piece.tolist() for piece in pieces[1:]] == [[[9.0, 0.0]], [[0.0, 9.0]]]


def test_cells_lie_where_the_path_passes_them_nearest():
    path = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0]])
    cell = np.array([[1.0, 0.5], [4.5, 3.0], [4.0, 0.0]])
    assert path_position(path, cell) == pytest.approx([1.0, 7.0, 4.0])


def test_stairs_become_a_straight_line_and_a_needed_corner_remains():
    stairs = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [3.0, 2.0], [3.0, 3.0]])
    cell = np.stack([np.linspace(0.0, 3.0, 20)] * 2, axis=1)
    assert path_length(shortened(stairs, cell, 0.9)) == pytest.approx(np.sqrt(18.0))
    corner = np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 5.0]])
    short = shortened(corner, corner, 0.5)
    assert 8.0 < path_length(short) < path_length(corner)
