"""The way out of a stall: one cell that all attend to, and a detour around an obstacle."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpc_cover.distributed.stall_escape import StallEscape, detour

number = st.floats(-5.0, 5.0)


def test_a_stalled_agent_attends_to_the_first_cell_owed_in_the_common_order():
    order = np.array([2, 0, 1])
    escape = StallEscape(order, 3)
    weight = np.array([1.0, 1.0, 0.0])
    for _ in range(3):
        assert (escape.attend(weight) == weight).all()
        assert not escape.stalled
    assert escape.attend(weight).tolist() == [1.0, 0.0, 0.0]
    assert escape.stalled
    better = np.array([1.0, 0.5, 0.0])
    assert (escape.attend(better) == better).all()
    assert not escape.stalled


def test_a_stalled_agent_with_nothing_owed_stays_put():
    escape = StallEscape(np.arange(2), 1)
    escape.attend(np.zeros(2))
    assert (escape.attend(np.zeros(2)) == 0.0).all()


def vectors(dimension):
    return st.lists(number, min_size=dimension, max_size=dimension).map(np.array)


@pytest.mark.parametrize("dimension", [2, 3])
@given(data=st.data(), turn=st.sampled_from([-1.0, 1.0]))
def test_nobody_goes_at_what_is_near(dimension, data, turn):
    wish, position, centre = (data.draw(vectors(dimension)) for _ in range(3))
    away = np.linalg.norm(centre - position)
    if away < 1e-3:
        return
    went = detour(wish, position, centre[None], np.array([3.0]), turn)
    towards = float(wish @ (centre - position)) / away
    if away <= 3.0 and towards > 0.0:
        assert float(went @ (centre - position)) == pytest.approx(0.0, abs=1e-9)
        assert np.linalg.norm(went) == pytest.approx(np.linalg.norm(wish))
        np.testing.assert_allclose(went, -detour(wish, position, centre[None], np.array([3.0]), -turn))
    else:
        np.testing.assert_array_equal(went, wish)


def test_left_leaves_it_on_the_right():
    went = detour(np.array([1.0, 0.0]), np.zeros(2), np.array([[1.0, 0.0]]), np.array([2.0]), 1.0)
    np.testing.assert_allclose(went, [0.0, 1.0])


def test_without_obstacles_the_wish_stays():
    wish = np.array([1.0, 2.0])
    assert detour(wish, np.zeros(2), np.empty((0, 2)), np.empty(0), 1.0) is wish
