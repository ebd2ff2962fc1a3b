"""Along a polyline of joint positions the limits hold, every leg is flown together, and the end is exact."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpc_cover.model.motion import roll_out
from mpc_cover.planning.initial_guess.joint_polyline import cut_short, fly_polyline

PERIOD = 0.5


def positions(start, velocity):
    return roll_out(start, velocity[0], np.diff(velocity, axis=0) / PERIOD, PERIOD)[0]


@st.composite
def flights(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**31)))
    agents, corners = draw(st.integers(1, 4)), draw(st.integers(2, 6))
    corner = rng.normal(scale=draw(st.sampled_from([0.1, 1.0, 10.0])), size=(corners, agents, 2))
    return corner, rng.uniform(0.3, 2.0, agents), rng.uniform(0.3, 2.0, agents), draw(st.booleans())


@settings(max_examples=60, deadline=None)
@given(flights())
def test_limits_hold_and_the_end_is_exact(flight):
    corner, speed, force, stopping = flight
    velocity = fly_polyline(corner, speed, force, PERIOD, range(len(corner)) if stopping else ())
    assert not velocity[[0, -1]].any()
    assert (np.linalg.norm(velocity, axis=2) <= speed * (1 + 1e-9)).all()
    assert (np.linalg.norm(np.diff(velocity, axis=0), axis=2) <= force * PERIOD * (1 + 1e-9)).all()
    path = positions(corner[0], velocity)
    np.testing.assert_allclose(path[-1], corner[-1], atol=1e-9)
    if stopping:  # every corner is a sample of the motion, at rest
        rests = path[~velocity.any(axis=(1, 2))]
        assert all(np.isclose(rests, point, atol=1e-9).all(axis=(1, 2)).any() for point in corner)


@settings(max_examples=30, deadline=None)
@given(flights(), st.integers(2, 60))
def test_what_is_cut_short_comes_to_rest_within_the_limits(flight, steps):
    corner, speed, force, _ = flight
    whole = fly_polyline(corner, speed, force, PERIOD)
    short = cut_short(whole, steps, force, PERIOD)
    assert len(short) == steps + 1
    assert not short[-1].any()
    assert (np.linalg.norm(np.diff(short, axis=0), axis=2) <= force * PERIOD * (1 + 1e-9)).all()
    if steps + 1 >= len(whole):
        np.testing.assert_array_equal(short[: len(whole)], whole)


def test_what_is_translated_stays_rigid_and_moves_with_the_slowest():
    start = np.array([[0.0, 0.0], [1.05, 0.0], [0.0, 1.05]])
    corner = start + np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 2.0], [0.0, 2.0]])[:, None]
    velocity = fly_polyline(corner, np.array([1.5, 0.5, 1.5]), np.array([1.0, 1.5, 1.5]), PERIOD)
    np.testing.assert_allclose(velocity, np.repeat(velocity[:, :1], 3, axis=1))
    assert np.linalg.norm(velocity, axis=2).max() == pytest.approx(0.5, rel=0.05)
