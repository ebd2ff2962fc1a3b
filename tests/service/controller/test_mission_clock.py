"""Mission time, and the grid of ticks."""

from threading import Event

import numpy as np

from mpc_cover.clock import VirtualClock
from mpc_cover.service.controller.mission_clock import MissionClock


def test_the_grid_is_never_rebased():
    clock = VirtualClock(1e6)
    mission_clock = MissionClock(clock, 0.1)
    mission_clock.start(1e6 + 0.1)
    due = []
    for late in (0.0, 0.03, 0.31, 0.0, 0.1, 0.0):
        mission_clock.next_tick()
        due.append(mission_clock.due_s)
        clock.wait_until(mission_clock.due_s + late, Event())
    ticks = (np.array(due) - 1e6) / 0.1
    np.testing.assert_allclose(ticks, [1, 2, 3, 6, 7, 8], atol=1e-6)


def test_mission_time_stands_still_while_paused():
    clock = VirtualClock(50.0)
    mission_clock = MissionClock(clock, 0.5, mission_time_s=7.0)
    clock.wait_until(60.0, Event())
    assert mission_clock.now() == 7.0
    mission_clock.start(61.0)
    assert mission_clock.now() == 7.0
    clock.wait_until(63.0, Event())
    assert mission_clock.now() == 9.0
    assert mission_clock.origin_s == 54.0
    mission_clock.pause()
    clock.wait_until(70.0, Event())
    assert mission_clock.now() == 9.0
    mission_clock.resume(40.0)
    assert mission_clock.now() == 30.0
