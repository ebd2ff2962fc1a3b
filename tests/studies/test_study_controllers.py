"""The receding horizon's rivals finish the same missions with the same plant."""

from dataclasses import replace

import numpy as np
import pytest
from study_fixtures import TINY, tiny, tiny_run

from mpc_cover.errors import UserError
from mpc_cover.information.build import make_map
from mpc_cover.mission.load import build_mission, load_mission
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.planning.budget import Budget
from mpc_cover.service.run.swarm_simulate import fly_swarm
from mpc_cover.studies.controllers import CONTROLLERS, check_flight, controller_of, run_flight
from mpc_cover.studies.sweep import SweepLaw, without_coordination
from mpc_cover.verification.check import check_trajectory

WEATHER = {
    "position_noise_m": 0.02,
    "input_noise_m_per_s2": 0.05,
    "wind_m_per_s2": [0.05, 0.0],
    "delay_s": 0.1,
    "slow_agents": {"a1": 0.6},
}


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("controller", ["sweep", "potential"])
def test_rivals_cover_everything_within_the_limits(controller, seed):
    result = run_flight(tiny_run(controller, seed).build(), controller, seed=seed)
    assert result.complete
    checks = {check.name: check.holds for check in check_trajectory(result.trajectory).checks}
    if controller == "sweep":  # has no eye for the others
        checks = {name: holds for name, holds in checks.items() if name not in ("separation", "connectivity")}
    assert all(checks.values()), checks


@pytest.mark.parametrize("controller", ["sweep", "potential"])
def test_rivals_are_the_same_twice(controller):
    first, second = (run_flight(tiny_run(controller, 5).build(), controller, seed=5).trajectory for _ in range(2))
    assert np.array_equal(first.position, second.position)


@pytest.mark.parametrize("controller", ["sweep", "potential"])
def test_rivals_cope_with_wind_noise_delay_and_a_slow_agent(controller):
    slow = {} if controller == "potential" else WEATHER["slow_agents"]  # there nobody looks out for the slow
    mission = tiny(disturbance={**WEATHER, "slow_agents": slow}, fleet={"communication_range_m": 4.0})
    assert run_flight(tiny_run(controller, 1, mission).build(), controller, seed=1).complete


@pytest.mark.parametrize(("law", "seed"), [({"alpha": 2.0, "core_m": 0.2, "random_part": 0.3}, 3), ({}, 4)])
def test_the_potential_law_of_a_study_is_the_one_of_a_simulation(law, seed):
    mission = tiny_run("potential", seed, tiny(potential=law)).build()
    result, simulated = run_flight(mission, "potential", seed=seed), fly_swarm(mission, seed=seed)
    for name in ("time", "position", "velocity", "input", "covered_at"):
        assert np.array_equal(getattr(result.trajectory, name), getattr(simulated.trajectory, name))
    assert result.complete == simulated.complete
    assert len(result.step_s) == sum(map(len, simulated.decision_times_s.values()))
    assert result.messages >= simulated.messages > 0


def test_the_sweep_flies_without_what_it_does_not_heed_and_is_judged_by_all_of_it():
    links = {"links": [["a1", "a2"]], "communication_range_m": 1.8}
    mission = tiny_run("sweep", 2, tiny(fleet=links, potential={"attract_beyond_m": 1.0})).build()
    flight = run_flight(mission, "sweep", seed=2)
    assert flight.complete
    assert flight.trajectory.mission is mission
    failed = {check.name for check in check_trajectory(flight.trajectory).failures}
    assert failed >= {"separation", "connectivity", "links kept"}
    unheeding = replace(flight.trajectory, mission=without_coordination(mission))
    asked = {check.name for check in check_trajectory(unheeding).checks}
    assert not asked & {"separation", "connectivity", "links kept"}


@pytest.mark.parametrize("name", ["box-3", "box-3-windy", "heterogeneous", "fig-4-2"])
def test_only_coordination_is_taken_from_a_mission(name):
    mission = load_mission(name)
    free = without_coordination(mission)
    assert (free.fleet.separation_min, free.fleet.communication_range, free.fleet.links) == (0.0, np.inf, ())
    same = mission.spec.fleet.model_copy(
        update={"separation_min_m": 0.0, "communication_range_m": None, "links": ()},
    )
    assert free.spec == mission.spec.model_copy(update={"fleet": same, "potential": free.spec.potential})
    assert np.array_equal(free.field.cell, mission.field.cell)


def test_what_cannot_fly_is_told_before_it_does():
    single = tiny(fleet={"dynamics": "single"})
    check_flight(single, "potential")
    for controller in ("mpc", "sweep"):
        with pytest.raises(UserError, match=r"fleet\.dynamics single"):
            check_flight(single, controller)
    with pytest.raises(UserError, match="slow_agents"):
        check_flight(tiny(disturbance={"slow_agents": {"a1": 0.5}}), "potential")


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
    at_rest = FleetState.nominal(mission.fleet.start, np.zeros((3, 2)), 0.0, settled=True)
    law.step(at_rest, make_map(mission), Budget.unlimited())
    own = np.array([strip.own.sum(axis=1) for strip in law.strips])
    assert own.tolist() == [[12, 0], [24, 0], [0, 36]]


def test_unknown_names_are_told_what_there_is():
    with pytest.raises(UserError, match="--controllers pid: is none: must be among mpc, sweep, potential"):
        controller_of("pid")
    assert [name for name, controller in CONTROLLERS.items() if controller.plans_ahead] == ["mpc"]
