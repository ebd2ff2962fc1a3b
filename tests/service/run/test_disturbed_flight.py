"""The closed loop with disturbed agents: delays, noise, and death, on a virtual clock."""

import numpy as np
import pytest
from service_fakes import small_mission
from sweep_laws import SharingLaw, StraightSweepLaw

from mpc_cover.service.run.simulate import simulate
from mpc_cover.verification.check import check_trajectory

WINDY = {"position_noise_m": 0.02, "input_noise_m_per_s2": 0.03, "wind_m_per_s2": [0.0, 0.05]}


def failures(trajectory):
    return {check.name for check in check_trajectory(trajectory).failures}


@pytest.mark.parametrize("disturbance", [WINDY, {**WINDY, "delay_s": 0.5}, {"delay_s": 0.33}])
def test_the_mission_is_flown_and_the_record_is_true(disturbance):
    mission = small_mission(disturbance=disturbance)
    law = StraightSweepLaw(mission)
    result = simulate(mission, law=law)
    assert result.complete
    assert not failures(result.trajectory)
    assert np.isfinite(result.trajectory.covered_at).all()
    assert not [event for event in result.events if "ignores" in event or "strays" in event]


def test_the_same_seed_gives_the_same_flight_and_another_one_does_not():
    mission = small_mission(disturbance=WINDY)
    first, again, other = (simulate(mission, law=StraightSweepLaw(mission), seed=seed) for seed in (4, 4, 5))
    np.testing.assert_array_equal(first.trajectory.position, again.trajectory.position)
    assert first.trajectory.position.shape != other.trajectory.position.shape or np.any(
        first.trajectory.position != other.trajectory.position
    )


def test_the_map_never_claims_what_was_not_truly_measured():
    mission = small_mission(disturbance=WINDY)
    law = StraightSweepLaw(mission)
    result = simulate(mission, law=law, seed=2)
    claimed, true = law.coverage.covered_at, result.trajectory.covered_at
    assert np.isfinite(claimed).all()
    assert (true <= claimed + 1e-6).all()


@pytest.mark.parametrize("died_s", [0.7, 1.9])
def test_a_death_leaves_a_motion_that_could_have_been(died_s):
    mission = small_mission(height=8.0, reach=20.0, time_limit_s=12.0)
    result = simulate(mission, law=SharingLaw(mission, goal_y=7.0), deaths={"a2": died_s})
    trajectory = result.trajectory
    assert result.lost == ("a2",)
    assert not result.complete
    assert not failures(trajectory)
    assert trajectory.meta["lost"]["a2"] == pytest.approx(died_s, abs=0.11)
    after = trajectory.time > died_s + 1.5
    assert not trajectory.velocity[after, 1].any()
    assert np.ptp(trajectory.position[after, 0, 1]) > 1.0


def test_the_real_thing_finishes_without_a_dead_agent():
    mission = small_mission(height=6.0, reach=20.0)
    result = simulate(mission, deaths={"a2": 1.3})
    assert result.complete
    assert result.lost == ("a2",)
    assert check_trajectory(result.trajectory).holds
