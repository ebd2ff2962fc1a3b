"""The law's wishes: bounded inputs, the random signal, tracking, and the way out of a tug-of-war."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpc_cover.distributed.potential_functions import Coordination, CoverageShape
from mpc_cover.distributed.potential_law import Bounds, LawParameters, PotentialLaw, random_signal

CELL = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]])
NOBODY = np.zeros((2, 2), dtype=bool)
STILL = np.zeros((2, 2))


def law(**parameters):
    bounds = Bounds(np.array([1.0, 0.5]), None, np.full(2, -9.0), np.full(2, 9.0))
    return PotentialLaw(CELL, bounds, Coordination(0.5, 1.0, 5.5, 4.0), LawParameters(**parameters), 0.5)


def test_an_infinite_gain_flies_at_full_speed_downhill():
    position = np.array([[2.0, 0.1], [-3.0, 0.0]])
    wish = law().desired_velocity(position, np.array([0.0, 1.0, 0.0]), NOBODY, STILL)
    np.testing.assert_allclose(np.linalg.norm(wish, axis=1), [1.0, 0.5])
    assert (wish[:, 0] > 0.0).all()
    assert (law().desired_velocity(position, np.zeros(3), NOBODY, STILL) == 0.0).all()


def test_a_finite_gain_is_proportional_until_it_is_cut():
    position = np.array([[0.0, 2.0], [0.0, 3.0]])
    weight = np.array([1.0, 0.0, 0.0])
    shape = CoverageShape(alpha=2.0, core_m=0.5)
    wish = law(gain=0.1, shape=shape).desired_velocity(position, weight, NOBODY, STILL)
    np.testing.assert_allclose(wish[:, 1], [-0.1 * 2.0 / 8.0, -0.1 * 2.0 / 27.0])
    wish = law(gain=1e6, shape=shape).desired_velocity(position, weight, NOBODY, STILL)
    np.testing.assert_allclose(wish[:, 1], [-1.0, -0.5])


def test_too_near_goes_apart_too_far_comes_back():
    near = law().desired_velocity(np.array([[0.0, 0.0], [0.6, 0.0]]), np.zeros(3), NOBODY, STILL)
    assert near[0, 0] < 0.0 < near[1, 0]
    far = law().desired_velocity(np.array([[0.0, 0.0], [5.0, 0.0]]), np.zeros(3), ~np.eye(2, dtype=bool), STILL)
    assert far[1, 0] < 0.0 < far[0, 0]


@given(seed=st.integers(0, 10**6))
def test_wishes_are_bounded(seed):
    rng = np.random.default_rng(seed)
    position = rng.uniform(-5, 5, (2, 2))
    wish = law(random=2.0).desired_velocity(position, rng.random(3), ~np.eye(2, dtype=bool), random_signal(rng, 2, 2))
    assert (np.linalg.norm(wish, axis=1) <= np.array([1.0, 0.5]) * (1.0 + 1e-12)).all()


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_random_signal_fills_the_unit_ball(dimension):
    signal = random_signal(np.random.default_rng(0), 4000, dimension)
    length = np.linalg.norm(signal, axis=1)
    assert length.max() <= 1.0
    np.testing.assert_allclose(signal.mean(axis=0), 0.0, atol=0.05)
    assert (length < 0.5).mean() == pytest.approx(0.5**dimension, abs=0.03)


def test_edges_of_one_choice_are_both_eithers_or_ones_own():
    position = np.array([[0.0, 0.0], [2.6, 0.0], [-0.2, 1.8], [2.2, 1.9]])
    bounds = Bounds(np.ones(4), None, np.full(2, -9.0), np.full(2, 9.0))
    kept = {
        edges: PotentialLaw(CELL, bounds, Coordination(0.5, 1.0, 3.0, 2.0), LawParameters(edges=edges), 0.5).kept_edges(
            position
        )
        for edges in ("both", "either", "own")
    }
    assert not kept["both"][0, 1]
    assert kept["either"][0, 1]
    assert kept["own"][1, 0]
    assert not kept["own"][0, 1]
