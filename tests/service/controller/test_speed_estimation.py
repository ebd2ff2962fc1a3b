"""Slow agents are found out by what they show, and nobody is called slow for the weather."""

import numpy as np
import pytest
from service_fakes import small_mission
from sweep_laws import SharingLaw

from mpc_cover.service.run.simulate import simulate
from mpc_cover.verification.check import check_trajectory

WINDY = {"position_noise_m": 0.02, "input_noise_m_per_s2": 0.03, "wind_m_per_s2": [0.0, 0.05]}


def test_a_slow_agent_is_found_out_and_planned_for_from_where_it_is():
    mission = small_mission(disturbance={"slow_agents": {"a2": 0.5}})
    law = SharingLaw(mission)
    result = simulate(mission, law=law)
    assert [index for index, _ in law.slowed][:1] == [1]
    assert law.slowed[-1][1] == pytest.approx(0.97 * 0.5, abs=0.02)
    assert "controller: a2 is slow: plans ask for 48% of its speed" in result.events
    assert "controller: a2 strays from its plan: the next one starts where it is" in result.events
    assert result.complete
    assert not check_trajectory(result.trajectory).failures
    assert np.linalg.norm(result.trajectory.velocity[:, 1], axis=1).max() <= 0.5 + 1e-9


def test_nobody_is_called_slow_for_the_weather():
    mission = small_mission(disturbance=WINDY)
    for seed in range(5):
        law = SharingLaw(mission)
        simulate(mission, law=law, seed=seed)
        assert law.states
        assert not law.slowed
