"""The horizon: beginnings of a mission plan end at rest within it, and go as the plan goes for as long as they can."""

from __future__ import annotations

import numpy as np
from closed_loop import PERIOD, small_mission
from hypothesis import given
from hypothesis import strategies as st

from mpc_cover.control.horizon import ended_at_rest, horizon_ocp, optimised_steps, spliced
from mpc_cover.model.fleet_constraints import FleetConstraints
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.verification.motion import verify_motion


def random_plan(mission, seed, steps):
    """Return a motion to rest within the limits, which braking is no trouble for."""
    rng, velocity = np.random.default_rng(seed), np.zeros((steps + 1, 2, 2))
    for n in range(1, steps):
        velocity[n] = velocity[n - 1] + PERIOD * rng.uniform(-1.0, 1.0, (2, 2))
        size = np.linalg.norm(velocity[n], axis=1, keepdims=True)
        velocity[n] *= np.minimum(1.0, 1.5 * PERIOD * (steps - n) / np.maximum(size, 1e-9))
        velocity[n] *= np.minimum(1.0, 0.7 / np.maximum(np.linalg.norm(velocity[n], axis=1, keepdims=True), 1e-9))
    return Trajectory.from_velocities(mission.fleet.start, velocity[0], velocity[1:], 3.0, PERIOD)


@given(seed=st.integers(0, 10**6), steps=st.integers(2, 40), horizon=st.integers(4, 20))
def test_beginnings_end_at_rest_within_the_horizon_the_longest_first(seed, steps, horizon):
    mission = small_mission(horizon)
    plan, fleet = random_plan(mission, seed, steps), FleetConstraints.of(mission.fleet)
    kept = steps + 1
    for beginning in ended_at_rest(plan, fleet, horizon):
        assert beginning.steps == horizon
        assert not beginning.velocity[-1].any()
        assert beginning.start_time == plan.start_time
        shared = min(steps, horizon)
        same = (beginning.velocity[: shared + 1] == plan.velocity[: shared + 1]).all(axis=(1, 2))
        alike = int(np.argmin(same)) if not same.all() else shared + 1
        assert alike <= kept
        kept = alike
        force = np.linalg.norm(beginning.input, axis=2)
        assert (force <= np.maximum(1.5, np.linalg.norm(plan.input, axis=2).max()) + 1e-9).all()


@given(seed=st.integers(0, 10**6), steps=st.integers(2, 40), horizon=st.integers(4, 20))
def test_what_is_resolved_leaves_time_to_brake_unless_the_plan_ends_within_the_horizon(seed, steps, horizon):
    mission = small_mission(horizon)
    plan, fleet = random_plan(mission, seed, steps), FleetConstraints.of(mission.fleet)
    resolved = optimised_steps(plan, fleet, horizon)
    assert resolved == (steps if steps <= horizon else max(1, horizon - 2))  # 1.5 m/s at 1.5 m/s^2 takes 1 s
    assert any(True for _ in ended_at_rest(plan, fleet, horizon))


def test_a_spliced_plan_is_the_new_beginning_and_then_the_rest():
    mission = small_mission()
    plan = random_plan(mission, 0, 12)
    fleet, cell = FleetConstraints.of(mission.fleet), mission.field.cell
    owed = np.ones((1, mission.field.size)), None
    ocp = horizon_ocp(plan, fleet, cell, owed, 6, 5)
    assert ocp.steps == 5
    np.testing.assert_array_equal(ocp.ends.end_position, plan.position[6])
    np.testing.assert_array_equal(ocp.ends.end_velocity, plan.velocity[6])
    assert horizon_ocp(plan, fleet, cell, owed, 12, 11).ends.end_position is None
    faster = np.concatenate([plan.velocity[:5], plan.velocity[6:7]])
    joined = spliced(plan, faster, 6)
    assert joined.steps == 11
    np.testing.assert_array_equal(joined.velocity[:5], plan.velocity[:5])
    np.testing.assert_array_equal(joined.velocity[5:], plan.velocity[6:])
    report = verify_motion(mission.fleet, joined.time, joined.position, joined.velocity, joined.input)
    assert all(check.holds for check in report.checks if check.name.startswith("dynamics"))
