"""The distributed law as a whole: it covers everything, keeps its bounds, and delays cost time, not safety."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mpc_cover.distributed.potential_functions import Coordination, coordination_of
from mpc_cover.distributed.potential_law import LawParameters
from mpc_cover.mission.fleet import Fleet
from mpc_cover.studies.map_timing import time_maps
from mpc_cover.studies.swarm import fly, run
from mpc_cover.studies.swarm_parameters import (
    AgeingInformation,
    KalmanInformation,
    LookInformation,
    Scenario,
    SwarmParameters,
    random_start,
)
from mpc_cover.studies.thesis_cases import CASES, as_double_integrators, constrained, free
from mpc_cover.verification.motion import verify_motion

SMALL = {
    "looks": LookInformation(3),
    "kalman": KalmanInformation(variance=1.0, noise=1.0, enough=0.25),
}


def small(information, delay=4, **changes):
    swarm = SwarmParameters(information=information, delay=delay, maps_every=5)
    return replace(
        Scenario(swarm, size_m=(6.0, 6.0), agents=5, separation_m=0.5, range_m=4.0), swarm=replace(swarm, **changes)
    )


def arrays_of(record):
    names = ("time", "position", "velocity", "input", "residual", "own_residual", "kept", "covered_at", "truth")
    return [getattr(record, name) for name in names]


@pytest.mark.parametrize("dynamics", ["single", "double"])
@pytest.mark.parametrize("delay", [0, 4, "hops"])
@pytest.mark.parametrize("kind", SMALL)
def test_covers_everything_apart_and_connected(kind, delay, dynamics):
    record = run(small(SMALL[kind], delay, dynamics=dynamics), 3)
    assert record.covered
    assert record.residual[-1] == 0.0
    assert (record.own_residual[-1] == 0.0).all(), "everyone knows"
    assert record.time_to(0.95) <= record.time_to_cover <= record.time_to_know
    assert record.closest >= 0.5
    assert record.bottleneck <= 4.0 + 1e-6
    assert (record.own_residual >= record.residual[:, None] - 1e-12).all(), "delayed maps over-estimate"
    assert (np.diff(record.residual) <= 0.0).all()
    if dynamics == "double":
        report = verify_motion(record.fleet, record.time, record.position, record.velocity, record.input)
        assert report.holds, str(report.first_failure)
    else:
        step = np.linalg.norm(np.diff(record.position, axis=0), axis=2)
        assert step.max() <= 0.5 * (1.0 + 1e-12)


def test_the_same_seed_gives_the_same_record_and_another_another():
    first, second, other = (run(small(SMALL["kalman"]), seed) for seed in (1, 1, 2))
    assert all((a == b).all() for a, b in zip(arrays_of(first), arrays_of(second), strict=True))
    assert not np.array_equal(first.position[0], other.position[0])


def test_the_record_is_whole():
    record = run(small(SMALL["kalman"]), 0)
    samples, agents, cells = len(record.time), 5, record.field.size
    assert record.position.shape == record.velocity.shape == (samples, agents, 2)
    assert record.input.shape == (samples - 1, agents, 2)
    assert record.kept.shape == (samples, agents, agents)
    maps = record.maps
    assert maps.true.shape == (len(maps.time), cells)
    assert maps.own.shape == maps.estimate.shape == (len(maps.time), agents, cells)
    np.testing.assert_allclose(maps.time, record.time[::5])
    edges = record.kept.sum(axis=(1, 2)) // 2
    assert (edges >= agents - 1).all()
    np.testing.assert_allclose(record.position[1:], record.position[:-1] + 0.5 * record.velocity[:-1])
    error = np.sqrt(np.mean((maps.estimate[-1] - record.truth) ** 2))
    assert error < np.sqrt(np.mean(record.truth**2)), "the estimates come near the field"
    assert record.distance.shape == (agents,)


def test_no_maps_unless_asked_for():
    record = run(replace(small(SMALL["looks"]), swarm=SwarmParameters(LookInformation(1))), 0)
    assert record.maps.time.size == record.maps.estimate.size == 0


def test_a_fleet_that_measures_two_things():
    scenario = small(LookInformation(1), 0)
    fleet, field = scenario.build(np.random.default_rng(0))
    nothing = -np.inf
    radius = np.array([[1.0, nothing], [1.0, nothing], [nothing, 0.8], [1.0, 0.8], [nothing, 1.2]])
    record = fly(replace(fleet, radius=radius), field, scenario.swarm, 0)
    assert record.covered


def test_links_of_a_mission_are_always_kept():
    scenario = small(LookInformation(1), 0)
    fleet, field = scenario.build(np.random.default_rng(0))
    start = np.array([[1.0 + i, 1.0] for i in range(5)])
    record = fly(replace(fleet, start=start, links=((0, 3),)), field, scenario.swarm, 0)
    assert record.covered
    assert np.linalg.norm(record.position[:, 0] - record.position[:, 3], axis=1).max() <= 4.0


def test_three_dimensions():
    scenario = Scenario(
        SwarmParameters(LookInformation(1), dynamics="double", time_limit_s=200.0),
        size_m=(3.0, 3.0, 2.0),
        agents=3,
        separation_m=0.4,
        range_m=3.5,
    )
    record = run(scenario, 0)
    assert record.covered
    assert verify_motion(record.fleet, record.time, record.position, record.velocity, record.input).holds


def test_a_patrol_goes_on_and_keeps_everything_young():
    scenario = Scenario(
        SwarmParameters(AgeingInformation(5.0), time_limit_s=120.0), size_m=(5.0, 5.0), agents=4, separation_m=0.3
    )
    record = run(scenario, 0)
    assert record.time[-1] == 120.0
    assert not record.covered
    assert record.worst_age[0] == 0.0
    late = record.time > 30.0
    assert record.worst_age[late].max() < 30.0, "left alone it would be 120 s"
    assert (record.mean_age <= record.worst_age).all()
    parked = run(replace(scenario, speed_max_m_per_s=1e-6), 0)
    assert parked.worst_age[-1] == 120.0


def stuck(patience_s, law, half=6.0):
    """Return two agents on a short leash, with as much owed on the left as on the right."""
    scenario = Scenario(
        SwarmParameters(LookInformation(1), law=law, patience_s=patience_s, time_limit_s=60.0),
        size_m=(2.0 * half, 0.5),
        agents=2,
        radius_m=0.6,
        separation_m=0.3,
        range_m=2.0,
    )
    fleet, field = scenario.build(np.random.default_rng(0))
    start = np.array([[half - 0.5, 0.25], [half + 0.5, 0.25]])
    return fly(replace(fleet, start=start), field, scenario.swarm, 0)


def test_a_tug_of_war_is_ended_by_attending_to_one_cell():
    still = LawParameters(random=0.0)
    assert not stuck(1e9, still).covered, "two agents pull each their way"
    assert stuck(5.0, still).covered


def test_a_saddle_is_left_by_the_random_signal():
    """5.17: one agent amid two cells that pull alike."""
    field = Scenario(size_m=(6.5, 0.5)).build(np.random.default_rng(0))[1]
    ends = replace(field, cell=field.cell[[0, -1]], weight=np.ones(2), part=np.ones(2))
    fleet = Fleet(
        ids=("a1",),
        start=np.array([[3.25, 0.25]]),
        input_max=np.ones(1),
        speed_max=np.ones(1),
        radius=np.full((1, 1), 1.0),
        separation_min=0.0,
        communication_range=np.inf,
        motion_min=np.array([0.0, 0.0]),
        motion_max=np.array([6.5, 0.5]),
    )
    law = LawParameters(gain=1e3, random=0.0)
    calm = SwarmParameters(LookInformation(1), law=law, patience_s=1e9, time_limit_s=60.0)
    assert not fly(fleet, ends, calm, 0).covered
    assert fly(fleet, ends, replace(calm, law=replace(law, random=0.1)), 0).covered


def test_delay_costs_time():
    looks = LookInformation(5)
    late = [run(constrained(looks), seed).time_to(0.99) for seed in range(4)]
    at_once = [run(constrained(looks, 0), seed).time_to(0.99) for seed in range(4)]
    assert np.mean(late) > np.mean(at_once)


def test_starts_are_apart_and_connected_or_refused():
    rng = np.random.default_rng(0)
    start = random_start(rng, 8, np.array([6.0, 6.0]), 0.5, 2.0)
    away = np.linalg.norm(start[:, None] - start[None], axis=2) + 9.0 * np.eye(8)
    assert away.min() >= 0.5
    assert away.min(axis=1).max() <= 2.0
    with pytest.raises(ValueError, match="no room"):
        random_start(rng, 50, np.array([1.0, 1.0]), 0.5, 2.0)


def test_the_timing_runs():
    taken = time_maps(0.317, steps=2)
    assert set(taken) == {"plain", "K = 15", "K = 15, in flight", "Kalman", "Kalman, drawing its readings"}
    assert all(each.shape == (2,) for each in taken.values())


def test_cases_are_the_thesis_numbers():
    for name, case in CASES.items():
        assert (case.agents, case.radius_m, case.speed_max_m_per_s) == (8, 1.0, 1.0)
        if name.startswith("6"):
            assert coordination_of(case.build(np.random.default_rng(0))[0]) == Coordination(0.5, 1.0, 5.5, 4.0)
            assert case.swarm.delay == (0 if "global" in name else 8)


@pytest.mark.slow
@pytest.mark.parametrize("dynamics", ["single", "double"])
def test_a_larger_field_by_hops(dynamics):
    scenario = replace(constrained(LookInformation(1)), size_m=(20.0, 20.0))
    scenario = replace(scenario, swarm=replace(scenario.swarm, delay="hops", dynamics=dynamics))
    records = [run(scenario, seed) for seed in range(30)]
    assert all(record.covered for record in records)
    assert min(record.closest for record in records) >= 0.5
    assert max(record.bottleneck for record in records) <= 5.5 + 1e-6


def test_double_integrators_fly_the_same_scenario():
    case = as_double_integrators(free(LookInformation(1)), 2.0)
    assert case.swarm.dynamics == "double"
    assert case.input_max_m_per_s2 == 2.0
