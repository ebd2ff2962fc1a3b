"""The local frame: a mission that is moved or scaled is the same in it, and what comes back starts where it began."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpc_cover.mission.load import build_mission
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.model.local_frame import LocalFrame
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.studies.mission_transforms import moved, scaled
from mpc_cover.studies.robustness_shapes import shapes

RAW = shapes()["L"] | {"disturbance": {"position_noise_m": 0.01, "wind_m_per_s2": [0.02, 0.0]}}


def local(raw):
    mission = build_mission(raw, "local")
    return LocalFrame.of(mission).mission(mission)


@pytest.mark.parametrize("offset", [(30.0, 30.0), (5e5, 4.6e6), (-1e7, 1e7)])
@pytest.mark.parametrize("factor", [1e-3, 0.01, 10.0, 1e3])
def test_a_moved_and_scaled_mission_is_the_same_to_the_last_bit(offset, factor):
    here, there = local(RAW), local(moved(scaled(RAW, factor), offset))
    if abs(offset[0]) < factor * 1e8:  # else the starts and corners themselves are rounded by more than the grid
        np.testing.assert_allclose(there.field.cell, here.field.cell, atol=1e-6 / factor)
    if factor >= 1.0:
        np.testing.assert_array_equal(there.field.cell, here.field.cell)
        np.testing.assert_array_equal(there.fleet.start, here.fleet.start)
    for name in ("input_max", "speed_max", "radius"):
        np.testing.assert_allclose(getattr(there.fleet, name), getattr(here.fleet, name), rtol=1e-6)
    assert there.spec.disturbance.position_noise_m == pytest.approx(0.01)
    assert here.fleet.sensing_radius_min == 1.0


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 1000), factor=st.sampled_from([1e-3, 0.5, 1.0, 1e3]), x=st.floats(-1e6, 1e6))
def test_a_motion_comes_back_from_the_given_state_and_obeys_the_dynamics(seed, factor, x):
    mission = build_mission(moved(scaled(RAW, factor), (x, -x)), "there")
    frame, rng = LocalFrame.of(mission), np.random.default_rng(seed)
    state = FleetState.nominal(mission.fleet.start, factor * rng.normal(size=(3, 2)), 7.0)
    inner = frame.state(state)
    plan = inner.trajectory(rng.normal(size=(5, 3, 2)), 0.5)
    metric = frame.metric(plan, state.position, state.velocity)
    np.testing.assert_array_equal(metric.position[0], state.position)
    np.testing.assert_array_equal(metric.velocity[0], state.velocity)
    np.testing.assert_allclose(metric.velocity[1:], factor * plan.velocity[1:], rtol=1e-12)
    again = frame.local(metric)
    np.testing.assert_allclose(again.position, plan.position, atol=1e-8 + 1e-9 * abs(x) / factor)
    own = Trajectory.from_velocities(
        metric.position[0], metric.velocity[0], metric.velocity[1:], metric.start_time, metric.period
    )
    np.testing.assert_array_equal(own.position, metric.position)


def test_whatever_others_may_fly_is_in_the_frame_as_well():
    mission = build_mission(moved(scaled(RAW, 10.0), (300.0, -40.0)), "local")
    frame, start = LocalFrame.of(mission), mission.fleet.start
    plan = Trajectory.from_velocities(start, np.zeros_like(start), np.ones((4, *start.shape)), 0.0, 0.5)
    state = replace(
        FleetState.nominal(start, np.zeros_like(start), 0.0),
        held={0: [plan.agent(0), plan.agent(1)]},
        obstacles={1: plan.agent(1)},
    )
    inside = frame.state(state)
    for index, motions in state.held.items():
        for ours, theirs in zip(inside.held[index], motions, strict=True):
            np.testing.assert_allclose(ours.position, frame.position(theirs.position), atol=1e-9)
    np.testing.assert_allclose(inside.held[0][1].position, inside.obstacles[1].position)
