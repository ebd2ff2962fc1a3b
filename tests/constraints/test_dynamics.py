"""Rows of the dynamics: every rolled-out motion satisfies them, and no other."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motions import PERIOD, random_motion

from mpc_cover.constraints.dynamics import dynamics_rows
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
