"""Whoever brakes stays in the box, and the rows that see to it are gradients."""

from __future__ import annotations

import numpy as np
import pytest
from flights import fleet_of
from hypothesis import given, settings
from hypothesis import strategies as st

from mpc_cover.constraints.box_overshoot import box_overshoot, box_overshoot_rows
from mpc_cover.constraints.rows import Layout
from mpc_cover.model.braking import braking_position
from mpc_cover.model.motion import roll_out

PERIOD = 0.5


EVERYTHING = 1e3


def motion_of(rng, agents, steps, *, size=4.0):
    """Return a random motion that ends at rest, and its fleet."""
    start = rng.uniform(0.0, size, (agents, 2))
    velocity = np.cumsum(rng.uniform(-0.5, 0.5, (steps + 1, agents, 2)), axis=0)
    velocity[-1] = 0.0
    position, _ = roll_out(start, velocity[0], np.diff(velocity, axis=0) / PERIOD, PERIOD)
    return position, velocity, start


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_whoever_brakes_stays_in_the_box_where_no_overrun_is_seen(seed):
    rng = np.random.default_rng(seed)
    position, velocity, start = motion_of(rng, 2, 6)
    fleet = fleet_of(start, motion_min=np.zeros(2), motion_max=np.full(2, 4.0), reaction_periods=2.0)
    inside = ((position > 0.02) & (position < 3.98)).all(axis=2)
    for sample, agent in zip(*np.nonzero(inside), strict=True):
        stop = braking_position(position[sample], velocity[sample], np.array([1e3]), fleet.input_max)[0, agent]
        out = np.maximum(0.01 - stop, 0.0), np.maximum(stop - 3.99, 0.0)
        assert box_overshoot(position, velocity, fleet)[:, sample, agent] == pytest.approx(np.array(out))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_overrun_rows_are_its_gradient(seed):
    rng = np.random.default_rng(seed)
    position, velocity, start = motion_of(rng, 2, 6)
    fleet = fleet_of(start, motion_min=np.zeros(2), motion_max=np.full(2, 4.0), reaction_periods=2.0)
    layout, first = Layout(6, 2, 2), 1
    rows = box_overshoot_rows(layout, position, velocity, fleet, EVERYTHING, first)
    change = 1e-6 * rng.normal(size=(2, *position.shape))

    def stop(q, v):
        return q + np.linalg.norm(v, axis=2, keepdims=True) / (2.0 * fleet.input_max[:, None]) * v

    gone = (stop(position + change[0], velocity + change[1]) - stop(position, velocity))[first:]
    expected = np.concatenate([-gone.ravel(), gone.ravel()])
    along = np.bincount(rows.row, rows.value * change.ravel()[rows.column], rows.count)
    assert along == pytest.approx(expected, abs=1e-9)
