"""Rows of the box, the trust region and given ends."""

from __future__ import annotations

import numpy as np
import pytest

from mpc_cover.constraints.boundary import BoundaryConditions, bound_rows
from mpc_cover.constraints.rows import Layout, stack


def columns(position, velocity):
    return np.concatenate([position.ravel(), velocity.ravel()])


def rows_of(position, ends, trust=0.5):
    """Return the dense matrix and bounds of a motion of one agent in the unit square."""
    layout = Layout(position.shape[0] - 1, 1, 2)
    blocks = bound_rows(layout, position, (np.zeros(2), np.ones(2)), trust, ends)
    matrix, lower, upper = stack(blocks, layout.size)
    return matrix.toarray(), lower, upper


REST = np.zeros((1, 2))
PATH = np.array([[[0.0, 0.0]], [[0.3, 0.0]], [[0.9, 0.0]]])


def test_bounds_hold_the_box_the_trust_region_and_given_ends():
    _, lower, upper = rows_of(PATH, BoundaryConditions(PATH[0], REST, None, REST))
    assert lower.tolist() == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.4, 0.0, *[0.0] * 4])
    assert upper.tolist() == pytest.approx([0.0, 0.0, 0.8, 0.5, 1.0, 0.5, *[0.0] * 4])


def test_free_ends_are_bounded_like_every_other_sample():
    matrix, lower, upper = rows_of(PATH, BoundaryConditions())
    assert matrix.shape[0] == 6
    assert (lower[0], upper[0]) == pytest.approx((0.0, 0.5))


def test_an_iterate_outside_the_box_may_stay_but_goes_no_farther_out():
    _, lower, upper = rows_of(np.array([[[1.2, 0.5]], [[1.2, 0.5]]]), BoundaryConditions())
    assert upper[2] == pytest.approx(1.2)
    assert lower[2] == pytest.approx(0.7)


def test_a_fixed_end_is_an_equality():
    _, lower, upper = rows_of(PATH, BoundaryConditions(None, None, PATH[-1], np.ones((1, 2))))
    assert lower[4:].tolist() == upper[4:].tolist() == pytest.approx([0.9, 0.0, 1.0, 1.0])


def test_a_closed_motion_satisfies_its_rows_and_an_open_one_does_not():
    matrix, lower, upper = rows_of(PATH, BoundaryConditions(closed=True))
    assert (lower[-4:] == upper[-4:]).all()
    closed = columns(PATH[[0, 1, 0]], np.ones((3, 1, 2)))
    assert matrix[-4:] @ closed == pytest.approx(np.zeros(4))
    assert np.abs(matrix[-4:] @ columns(PATH, np.ones((3, 1, 2)))).max() == pytest.approx(0.9)
