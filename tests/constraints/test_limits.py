"""Rows of speed and input limits against the discs that they stand for."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from motions import PERIOD, random_motion

from mpc_cover.constraints.facets import inscribed
from mpc_cover.constraints.limits import input_rows, speed_rows
from mpc_cover.constraints.rows import Layout, stack

SHAPES = {"agents": st.integers(1, 3), "steps": st.integers(1, 6), "dimension": st.sampled_from([2, 3])}


def columns(position, velocity):
    return np.concatenate([position.ravel(), velocity.ravel()])


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
