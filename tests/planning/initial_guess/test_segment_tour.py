"""Tours over lanes: every lane once, and never longer than visiting the nearest one next."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
import pytest

from mpc_cover.planning.initial_guess.path_geometry import path_length
from mpc_cover.planning.initial_guess.segment_tour import segment_tour


def keys(lanes):
    return sorted(tuple(sorted(map(tuple, lane.tolist()))) for lane in lanes)


def shortest(lanes):
    """Return the length of the shortest open tour, by enumeration."""
    lengths = []
    for order in permutations(range(len(lanes))):
        for flips in product((1, -1), repeat=len(lanes)):
            path = np.concatenate([lanes[i][::flip] for i, flip in zip(order, flips, strict=True)])
            lengths.append(path_length(path))
    return min(lengths)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("dimension", [2, 3])
def test_each_lane_is_flown_once_and_small_tours_are_nearly_the_shortest(seed, dimension):
    rng = np.random.default_rng(seed)
    begin = rng.uniform(0.0, 10.0, (5, dimension))
    lanes = np.stack([begin, begin + rng.uniform(-3.0, 3.0, (5, dimension))], axis=1)
    tour = segment_tour(lanes, np.zeros(dimension))
    assert keys(tour) == keys(lanes)
    assert path_length(tour.reshape(-1, dimension)) <= 1.1 * shortest(lanes)


def test_parallel_lanes_are_flown_back_and_forth():
    lanes = np.array([[[0.0, y], [10.0, y]] for y in (4.0, 0.0, 2.0, 6.0)])
    tour = segment_tour(lanes, np.zeros(2))
    assert tour[:, 0, 1].tolist() == [0.0, 2.0, 4.0, 6.0]
    assert path_length(tour.reshape(-1, 2)) == pytest.approx(46.0)


def test_one_lane_is_a_tour():
    lane = np.array([[[0.0, 0.0], [3.0, 0.0]]])
    assert segment_tour(lane, np.array([4.0, 0.0])).tolist() == [[[3.0, 0.0], [0.0, 0.0]]]
