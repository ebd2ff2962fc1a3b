"""The receding horizon's rivals finish the same missions with the same plant."""

import numpy as np
import pytest
from study_fixtures import TINY, tiny, tiny_run

from mpc_cover.errors import UserError
from mpc_cover.mission.load import build_mission
from mpc_cover.service.run.simulate import simulate
from mpc_cover.studies.controllers import CONTROLLERS, controller_of
from mpc_cover.studies.sweep import SweepLaw
from mpc_cover.verification.check import check_trajectory


def flown(controller, mission, seed=0):
    law = controller_of(controller).make(mission, "piqp", seed)
    return simulate(mission, seed=seed, law=law)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("controller", ["sweep", "potential"])
def test_rivals_cover_everything_within_the_limits(controller, seed):
    result = flown(controller, tiny_run(controller, seed).build(), seed)
    assert result.complete
    checks = {check.name: check.holds for check in check_trajectory(result.trajectory).checks}
    if controller == "sweep":  # has no eye for the others
        checks = {name: holds for name, holds in checks.items() if name not in ("separation", "connectivity")}
    assert all(checks.values()), checks


@pytest.mark.parametrize("controller", ["sweep", "potential"])
def test_rivals_are_the_same_twice(controller):
    first, second = (flown(controller, tiny_run(controller, 5).build(), 5).trajectory for _ in range(2))
    assert np.array_equal(first.position, second.position)


@pytest.mark.parametrize("controller", ["sweep", "potential"])
def test_rivals_cope_with_wind_noise_delay_and_a_slow_agent(controller):
    weather = {
        "position_noise_m": 0.02,
        "input_noise_m_per_s2": 0.05,
        "wind_m_per_s2": [0.05, 0.0],
        "delay_s": 0.1,
        "slow_agents": {"a1": 0.6},
    }
    mission = tiny(disturbance=weather, fleet={"communication_range_m": 4.0})
    result = flown(controller, tiny_run(controller, 1, mission).build(), 1)
    assert result.complete


def test_strips_go_by_ability_and_speed():
    agents = [
        {"id": "a1", "start_m": [0.5, 0.5], "speed_max_m_per_s": 0.5},
        {"id": "a2", "start_m": [1.5, 0.5]},
        {"id": "a3", "start_m": [2.5, 0.5], "sensing_radius_m": {"heat": 0.7}},
    ]
    defaults = {**TINY["fleet"]["defaults"], "sensing_radius_m": {"gas": 0.7}}
    raw = {**TINY, "magnitudes": ["gas", "heat"], "fleet": {**TINY["fleet"], "agents": agents, "defaults": defaults}}
    mission = build_mission(raw, "test")
    law = SweepLaw(mission)
    law.prepare(mission.fleet.start, np.zeros((3, 2)), 0.0, deadline=None)
    own = np.array([strip.own.sum(axis=1) for strip in law._strips])
    assert own.tolist() == [[12, 0], [24, 0], [0, 36]]


def test_unknown_names_are_told_what_there_is():
    with pytest.raises(UserError, match="--controllers pid: is none: must be among mpc, sweep, potential"):
        controller_of("pid")
    assert [name for name, controller in CONTROLLERS.items() if controller.plans_ahead] == ["mpc"]
