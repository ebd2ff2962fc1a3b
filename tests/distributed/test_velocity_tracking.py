"""Tracking a wished velocity within the limits."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mpc_cover.distributed.velocity_tracking import limited, track


@given(seed=st.integers(0, 10**6))
def test_tracking_stays_within_the_limits_and_arrives(seed):
    rng = np.random.default_rng(seed)
    most, fastest, period = np.array([1.5, 0.7]), np.array([1.0, 2.0]), 0.5
    velocity = limited(rng.normal(size=(2, 2)) * 3.0, fastest)
    wish = rng.normal(size=(2, 2)) * 3.0
    for _ in range(20):
        force = track(velocity, wish, most, fastest, period)
        assert (np.linalg.norm(force, axis=1) <= most * (1.0 + 1e-12)).all()
        velocity = velocity + period * force
        assert (np.linalg.norm(velocity, axis=1) <= fastest * (1.0 + 1e-12)).all()
    np.testing.assert_allclose(velocity, limited(wish, fastest), atol=1e-9)
