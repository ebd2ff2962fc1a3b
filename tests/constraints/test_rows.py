"""Rows of dynamics, limits and bounds against what they stand for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motions import PERIOD, random_motion

from mpc_cover.constraints.boundary import BoundaryConditions, bound_rows
from mpc_cover.constraints.dynamics import dynamics_rows
from mpc_cover.constraints.facets import inscribed
from mpc_cover.constraints.limits import input_rows, speed_rows
from mpc_cover.constraints.rows import Layout, stack

SHAPES = {"agents": st.integers(1, 3), "steps": st.integers(1, 6), "dimension": st.sampled_from([2, 3])}


def columns(position, velocity):
    return np.concatenate([position.ravel(), velocity.ravel()])


@given(seed=st.integers(0, 10**6), **SHAPES)
def test_every_rolled_out_motion_satisfies_the_dynamics_and_no_perturbed_one(seed, agents, steps, dimension):
    rng = np.random.default_rng(seed)
    position, velocity = random_motion(rng, steps, agents, dimension)
    layout = Layout(steps, agents, dimension)
    matrix, lower, upper = stack([dynamics_rows(layout, PERIOD)], layout.size)
    x = columns(position, velocity)
    assert matrix @ x == pytest.approx(lower, abs=1e-9)
    assert (lower == upper).all()
    x[rng.integers(x.size)] += 0.1
    assert np.abs(matrix @ x - lower).max() > 1e-3


@given(seed=st.integers(0, 10**6), **SHAPES)
def test_what_the_limit_rows_allow_is_within_the_discs(seed, agents, steps, dimension):
    rng = np.random.default_rng(seed)
    position, velocity = random_motion(rng, steps, agents, dimension)
    layout, facets = Layout(steps, agents, dimension), inscribed(dimension, 8)
    limit = np.full(agents, 0.8)
    _, other = random_motion(rng, steps, agents, dimension)
    other[0] = velocity[0]
    x = columns(position, other)
    for block, size in (
        (speed_rows(layout, velocity, limit, facets), np.linalg.norm(other[1:], axis=2)),
        (
            input_rows(layout, velocity, limit, PERIOD, facets),
            np.linalg.norm(np.diff(other, axis=0) / PERIOD, axis=2),
        ),
    ):
        matrix, lower, upper = stack([block], layout.size)
        value = matrix @ x
        assert value.size == steps * agents * len(facets.normal)
        allowed = ((value >= lower) & (value <= upper)).reshape(steps, agents, -1).all(axis=2)
        assert (size[allowed] <= 0.8 + 1e-9).all()
        assert not allowed[size > 0.8 + 1e-9].any()
        assert allowed[size <= 0.8 * facets.shrink - 1e-9].all()


@given(seed=st.integers(0, 10**6), **SHAPES)
def test_an_iterate_within_its_limits_satisfies_the_rows(seed, agents, steps, dimension):
    position, velocity = random_motion(np.random.default_rng(seed), steps, agents, dimension)
    layout, facets = Layout(steps, agents, dimension), inscribed(dimension, 8)
    speed = np.linalg.norm(velocity[1:], axis=2).max(axis=0)
    force = np.linalg.norm(np.diff(velocity, axis=0) / PERIOD, axis=2).max(axis=0)
    blocks = [
        speed_rows(layout, velocity, speed * (1 + 1e-9), facets),
        input_rows(layout, velocity, force * (1 + 1e-9), PERIOD, facets),
    ]
    matrix, lower, upper = stack(blocks, layout.size)
    value = matrix @ columns(position, velocity)
    assert (value >= lower - 1e-9).all()
    assert (value <= upper + 1e-9).all()


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
