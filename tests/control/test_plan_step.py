"""Plans with longer steps than the period of control: the same motion on a finer grid, at every tick."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpc_cover.errors import InvalidInputError
from mpc_cover.mission.load import build_mission, load_mission
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.offline import PlanOptions, plan_mission
from mpc_cover.service.run.simulate import simulate
from mpc_cover.verification.check import check_trajectory


def mission_of(side=5.0, **control):
    """Return two agents of box-3 on a square."""
    raw = json.loads(load_mission("box-3").to_json())
    raw["area"]["shape"] |= {"max_m": [side, side]}
    raw["fleet"]["agents"] = [{"id": "a1", "start_m": [0.6, 0.6]}, {"id": "a2", "start_m": [1.6, 0.6]}]
    given_ = {"state_period_s": 0.05, "period_s": 0.1, "horizon_steps": 12, "planning_time_s": 1.0} | control
    return build_mission(raw | {"control": given_, "planning": {"duration_s": 8.0}}, "test")


@given(seed=st.integers(0, 10**6), parts=st.integers(1, 10))
def test_a_subdivided_motion_is_the_same_motion(seed, parts):
    velocity = np.random.default_rng(seed).uniform(-1.0, 1.0, (7, 2, 2))
    motion = Trajectory.from_velocities(np.ones((2, 2)), velocity[0], velocity[1:], 3.0, 0.5)
    fine = motion.subdivided(parts)
    assert fine.steps == parts * motion.steps
    assert fine.period == pytest.approx(0.5 / parts)
    for instant in np.linspace(3.0, motion.end_time, 23):
        for one, other in zip(fine.at(instant), motion.at(instant), strict=True):
            np.testing.assert_allclose(one, other, atol=1e-12)


def test_a_long_horizon_at_a_short_period_flies_as_one_at_the_step_of_its_plans():
    fine, coarse = mission_of(plan_step_s=0.5), mission_of(period_s=0.5, state_period_s=0.1)
    flights = [simulate(mission) for mission in (fine, coarse)]
    for mission, flight in zip((fine, coarse), flights, strict=True):
        assert flight.complete
        assert check_trajectory(flight.trajectory).holds
        assert len(flight.steps) > 0.8 * flight.trajectory.end_time / mission.spec.control.period_s
    last = [np.quantile(flight.trajectory.covered_at, 0.99) for flight in flights]
    assert last[0] <= 1.25 * last[1]


def test_offline_plans_have_looks_once_a_period_and_inputs_once_a_step():
    plan = plan_mission(mission_of(plan_step_s=0.5), PlanOptions(starts=2))
    assert np.diff(plan.time) == pytest.approx(0.1)
    assert check_trajectory(plan).holds
    held = plan.input.reshape(-1, 5, 2, 2)
    np.testing.assert_allclose(held, np.repeat(held[:, :1], 5, axis=1), atol=1e-9)


@pytest.mark.parametrize(
    ("control", "where", "right"),
    [
        ({"plan_step_s": 0.05}, "control.plan_step_s", "at least period_s 0.1"),
        ({"plan_step_s": 0.25}, "control.plan_step_s", "multiple of period_s 0.1, as 0.2 or 0.3"),
        ({"plan_step_s": 2.0}, "control.plan_step_s", "at most two sensing radii, 2 m: at most 1.33 s"),
        ({"plan_step_s": 1.0, "horizon_steps": 400}, "control.plan_step_s", "at most 2000"),
        ({"plan_step_s": -1.0}, "control.plan_step_s", "greater than 0"),
        ({"plan_step_s": "long"}, "control.plan_step_s", "must be a number"),
        ({"plan_step_s": 0.5, "horizon_steps": 3}, "control.horizon_steps", "must be at least 4"),
        ({"plan_step_s": 0.1, "horizon_steps": 9}, "control.horizon_steps", "must be at least 12"),
    ],
)
def test_a_step_that_does_not_fit_is_refused_with_what_would(control, where, right):
    with pytest.raises(InvalidInputError) as caught:
        mission_of(**control)
    assert any(problem.path == where and right in str(problem) for problem in caught.value.problems), caught.value
