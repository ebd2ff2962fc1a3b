"""A fleet without a controller on a virtual clock: it finishes, whatever is lost, and nothing comes too near."""

import numpy as np
import pytest
from swarm_missions import swarm_mission

from mpc_cover.errors import UserError
from mpc_cover.information.build import true_field
from mpc_cover.mission.load import load_mission
from mpc_cover.service.run.swarm_simulate import fly_swarm
from mpc_cover.trajectory_file import save_trajectory
from mpc_cover.verification.check import check_trajectory

WIND = {"position_noise_m": 0.02, "input_noise_m_per_s2": 0.05, "wind_m_per_s2": [0.03, 0.0]}

KALMAN = {"kind": "kalman", "noise_variance": 1.0, "prior_variance": 4.0, "target_variance": 0.25}


def holds(flight):
    report = check_trajectory(flight.trajectory)
    assert report.holds, str(report.first_failure)
    return True


@pytest.mark.parametrize(
    "sections",
    [
        {},
        {"fleet": {"dynamics": "single"}},
        {"area": {"looks": 3}},
        {"potential": {"delay_samples": 6}},
        {"potential": {"spare_edges": False, "gain_m2_per_s": 2.0}},
        {"fleet": {"links": [["a1", "a2"]]}},
        {"disturbance": WIND},
        {"information": KALMAN},
        {"information": KALMAN, "fleet": {"dynamics": "single"}, "potential": {"delay_samples": 4}},
        {"information": KALMAN, "disturbance": WIND},
        {"information": {"kind": "effective", "level": 1.5, "rim": 0.3}},
    ],
    ids=[
        *("plain", "single", "three looks", "delayed", "tree only", "link", "windy"),
        *("kalman", "kalman single delayed", "kalman windy", "effective"),
    ],
)
def test_all_is_covered_and_verified(sections):
    mission = swarm_mission(**sections)
    flight = fly_swarm(mission, seed=2)
    assert flight.complete
    assert np.isfinite(flight.trajectory.covered_at).all()
    assert holds(flight)
    if mission.fleet.links:
        apart = np.linalg.norm(flight.trajectory.position[:, 0] - flight.trajectory.position[:, 1], axis=1)
        assert apart.max() <= 3.5
    if "windy" not in str(sections):
        assert sum("and everyone knows" in text for text in flight.events) == 3


def test_everyone_ends_with_an_estimate_of_the_field_that_those_who_only_guess_do_not_have():
    mission = swarm_mission(information=KALMAN)
    flight, truth = fly_swarm(mission, seed=1), true_field(mission)
    assert set(flight.estimate_errors) == {"a1", "a2", "a3"}
    # variances are 0.25 at the most, and their roots what errors come to
    assert max(flight.estimate_errors.values()) < 0.5 < np.sqrt((truth**2).mean())
    assert any("its own estimate of the field is off by" in text for text in flight.events)
    assert not fly_swarm(swarm_mission(), seed=1).estimate_errors


def test_readings_are_in_words_and_take_few_bytes():
    plain = fly_swarm(swarm_mission(area={"looks": 4}), seed=1)
    read = fly_swarm(swarm_mission(information=KALMAN), seed=1)
    assert read.bytes / read.messages > plain.bytes / plain.messages
    assert read.bytes / read.messages < 2.0 * plain.bytes / plain.messages


def test_the_same_seed_gives_the_same_bytes_and_another_another(tmp_path):
    mission, files = swarm_mission(), []
    for number, seed in enumerate((5, 5, 6)):
        files.append(tmp_path / f"{number}.npz")
        save_trajectory(fly_swarm(mission, seed=seed).trajectory, files[-1])
    first, second, other = (file.read_bytes() for file in files)
    assert first == second
    assert first != other


@pytest.mark.parametrize("time_s", [0.0, 2.2, 2.3, 4.9, 8.0])
@pytest.mark.parametrize("who", ["a1", "a3"])
def test_the_others_finish_without_one_and_stay_together(who, time_s):
    flight = fly_swarm(swarm_mission(4), seed=1, deaths={who: time_s})
    assert flight.complete
    assert flight.lost == (who,)
    assert holds(flight), "separation from the dead, connectivity of the others"
    assert np.isfinite(flight.trajectory.covered_at).all()


def test_space_has_room_for_it_too():
    """Three dimensions, and a range that just suffices to hear whom one could meet."""
    flight = fly_swarm(load_mission("volume-3"), seed=0)
    assert flight.complete
    assert holds(flight)


def test_two_may_die_and_the_last_one_finishes():
    flight = fly_swarm(swarm_mission(3), deaths={"a2": 2.7, "a1": 5.0})
    assert flight.complete
    assert holds(flight)


def test_a_dead_agent_that_rests_before_the_last_cell_is_gone_around():
    """Behind it lies a cell that a potential alone never reaches."""
    flight = fly_swarm(swarm_mission(3, size=3.0, area={"looks": 4}), seed=20, deaths={"a3": 3.4})
    assert flight.complete
    assert holds(flight)


def test_when_all_die_nothing_is_complete():
    flight = fly_swarm(swarm_mission(2), deaths={"a1": 1.0, "a2": 2.0})
    assert not flight.complete


def test_time_runs_out():
    flight = fly_swarm(swarm_mission(control={"time_limit_s": 3.0}))
    assert not flight.complete
    assert any("gives up after 3 s" in text for text in flight.events)


@pytest.mark.parametrize(
    ("sections", "message"),
    [
        ({"disturbance": {"slow_agents": {"a1": 0.5}}}, "slow_agents"),
        ({"fleet": {"communication_range_m": 1.9}}, "must be at least"),
        ({"disturbance": {"input_noise_m_per_s2": 0.5}}, "must be at least"),
    ],
)
def test_a_mission_that_the_law_cannot_fly_is_refused(sections, message):
    with pytest.raises(UserError, match=message):
        fly_swarm(swarm_mission(**sections))
