"""Bounds are tightened by the tube, and what the lost and the slow change."""

from __future__ import annotations

import numpy as np
import pytest
from closed_loop import small_mission
from flights import fleet_of

from mpc_cover.errors import InvalidInputError
from mpc_cover.mission.load import build_mission
from mpc_cover.model.constraint_tightening import slowed, tightened, without_lost
from mpc_cover.model.tube import tube_of


def disturbed(mission, **disturbance):
    raw = mission.spec.model_dump(by_alias=True, exclude_none=True)
    return build_mission({**raw, "disturbance": disturbance}, "small")


def test_bounds_are_tightened_by_the_tube():
    mission = disturbed(small_mission(), position_noise_m=0.01, input_noise_m_per_s2=0.05)
    tight, tube = tightened(mission), tube_of(mission)
    assert tube.position_m > 0.01
    assert tight.separation_min == pytest.approx(0.5 + 2 * tube.position_m)
    assert tight.communication_range == pytest.approx(3.0 - 2 * tube.position_m)
    assert tight.input_max == pytest.approx(1.5 - tube.input_m_per_s2)


def test_without_disturbances_nothing_is_tightened():
    mission = small_mission()
    assert tightened(mission) is mission.fleet


def test_disturbances_that_leave_no_room_are_a_clear_error():
    near = [{"id": "a1", "start_m": [0.6, 0.6]}, {"id": "a2", "start_m": [1.2, 0.6]}]
    with pytest.raises(InvalidInputError, match="leaves no room"):
        tightened(disturbed(small_mission(agents=near), position_noise_m=0.1))


def test_the_lost_measure_nothing_and_keep_no_links():
    fleet = fleet_of(np.zeros((3, 2)), links=((0, 1), (1, 2)))
    left = without_lost(fleet, np.array([True, False, False]))
    assert left.lost == (0,)
    assert left.links == ((1, 2),)
    assert left.radius.tolist() == [[-np.inf], [1.0], [1.0]]


def test_the_slow_are_as_fast_as_their_share():
    assert slowed(fleet_of(np.zeros((2, 2))), np.array([0.5, 1.0])).speed_max.tolist() == [0.75, 1.5]
