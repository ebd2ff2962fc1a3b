"""Lanes, snakes, strips and who takes which."""

from __future__ import annotations

import numpy as np
import pytest
from motions import PERIOD, grid

from mpc_cover.planning.initial_guess.lanes import assign, assign_pieces, cut_lanes, cut_snake, strips, swath_of


def test_lanes_are_as_few_as_the_swath_allows_and_leave_no_cell_out():
    swath = swath_of(1.0, 1.5, PERIOD)
    assert swath.half_width == pytest.approx(np.sqrt(1.0 - 0.375**2))
    cell = grid(20, 0.5)
    lanes = cut_lanes(cell, swath, 0)
    across = np.array([lane.low[1] for lane in lanes])
    assert len(lanes) == 5  # four rows of half a metre each
    assert np.abs(cell[:, 1][:, None] - across).min(axis=1).max() <= swath.half_width
    assert all(lane.low[1] == lane.high[1] for lane in lanes)
    assert len(cut_lanes(cell, swath, 0, count=6)) == 6
    assert cut_lanes(np.array([[1.0, 1.0]]), swath, 0)[0].low.tolist() == [1.0, 1.0]


def test_a_cut_snake_is_one_path_in_pieces_of_the_shares_asked_for():
    lanes = cut_lanes(grid(20, 0.5), swath_of(1.0, 1.5, PERIOD), 0)
    pieces = cut_snake(lanes, np.array([1.0, 2.0]), mirrored=False, upward=True)
    length = [np.linalg.norm(np.diff(piece, axis=0), axis=1).sum() for piece in pieces]
    assert length[1] == pytest.approx(2.0 * length[0])
    assert pieces[0][-1] == pytest.approx(pieces[1][0])


def test_pieces_go_to_whoever_is_near_in_the_better_direction():
    pieces = [np.array([[0.0, 0.0], [4.0, 0.0]]), np.array([[9.0, 9.0], [5.0, 9.0]])]
    flown = assign_pieces(pieces, np.array([[5.0, 8.0], [4.0, 1.0]]), np.ones(2))
    assert flown[0][0].tolist() == [5.0, 9.0]
    assert flown[1][0].tolist() == [4.0, 0.0]


def test_strips_share_out_in_proportion():
    parts = strips(grid(10), np.array([3.0, 1.0]), 0)
    assert [len(part) for part in parts] == [75, 25]
    assert parts[0][:, 0].max() <= parts[1][:, 0].max()


@pytest.mark.parametrize("agents", [3, 8])
def test_assignment_is_a_permutation_and_takes_the_obvious_one(agents):
    start = np.stack([np.arange(agents), np.zeros(agents)], axis=1)
    goal = start[::-1] + np.array([0.0, 0.5])
    assert assign(start, goal) == list(range(agents))[::-1]
