"""Random starts: apart, connected, in the box, and the same for a seed."""

import numpy as np
import pytest
from study_fixtures import tiny

from mpc_cover.errors import UserError
from mpc_cover.mission.load import load_mission
from mpc_cover.model.tube import tube_of
from mpc_cover.studies.starts import random_starts
from mpc_cover.verification.connectivity import bottleneck


def apart(start):
    one, two = np.triu_indices(len(start), 1)
    return np.linalg.norm(start[one] - start[two], axis=1)


@pytest.mark.parametrize("seed", range(20))
def test_they_are_apart_and_connected_and_in_the_box(seed):
    mission = load_mission("box-3")
    start = random_starts(mission, seed)
    assert start.shape == (3, 2)
    assert (start >= 0.0).all()
    assert (start <= 10.0).all()
    assert apart(start).min() > 0.5
    assert bottleneck(apart(start)[None], 3)[0] < 5.5


def test_a_seed_gives_the_same_starts_and_another_seed_others():
    mission = load_mission("box-3")
    assert np.array_equal(random_starts(mission, 3), random_starts(mission, 3))
    assert not np.array_equal(random_starts(mission, 3), random_starts(mission, 4))


def test_linked_agents_start_within_range_of_each_other():
    mission = load_mission("fixed-topology")
    for seed in range(10):
        start = random_starts(mission, seed)
        for one, two in mission.fleet.links:
            assert np.linalg.norm(start[one] - start[two]) < mission.fleet.communication_range


def test_without_separation_or_range_all_of_the_box_is_used():
    mission = tiny(fleet={"separation_min_m": 0.0, "communication_range_m": None})
    start = np.concatenate([random_starts(mission, seed) for seed in range(50)])
    assert start.min() < 0.3
    assert start.max() > 2.7


def test_disturbed_fleets_start_with_room_to_stray():
    mission = tiny(disturbance={"position_noise_m": 0.05})
    stray = tube_of(mission).position_m
    assert stray > 0.05
    for seed in range(10):
        start = random_starts(mission, seed)
        assert start.min() >= stray
        assert start.max() <= 3.0 - stray
        assert apart(start).min() >= 0.4 + 2.0 * stray


def test_a_box_without_room_is_a_clear_error():
    agents = [{"id": "a1", "start_m": [0.0, 0.0]}, {"id": "a2", "start_m": [0.4, 0.0]}]
    mission = tiny(area={"motion_max_m": [0.4, 0.01]}, fleet={"agents": agents})
    with pytest.raises(UserError, match=r"found no starts for 2 agents 0.4 m apart .* give them more room"):
        random_starts(mission, 0)


def test_a_box_in_which_agents_stray_from_wall_to_wall_is_a_clear_error():
    agents = [{"id": "a1", "start_m": [0.0, 0.0]}, {"id": "a2", "start_m": [0.5, 0.0]}]
    narrow = {"area": {"motion_max_m": [3.0, 0.2]}, "fleet": {"agents": agents}}
    with pytest.raises(UserError, match="found no starts for 2 agents"):
        random_starts(tiny(**narrow, disturbance={"position_noise_m": 0.15}), 0)
