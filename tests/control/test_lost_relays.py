"""A relay is lost: those who are left meet, before anything else, and before the mission is over."""

from __future__ import annotations

import numpy as np
from flights import mission_of

from mpc_cover.control.receding_horizon import RecedingHorizon
from mpc_cover.planning.initial_guess.rendezvous import out_of_range

START = [[1.0, 1.0], [3.0, 1.0], [5.0, 1.0]]


def mission_in_a_row(start=START, radius=2.0):
    """Return three agents in a row, whose middle one keeps the others in touch."""
    return mission_of(
        {
            "schema": 1,
            "name": "row",
            "area": {"shape": {"kind": "box", "min_m": [0.0, 0.0], "max_m": [6.0, 2.0]}, "cell_size_m": 0.5},
            "fleet": {
                "defaults": {"sensing_radius_m": radius, "input_max_m_per_s2": 1.5, "speed_max_m_per_s": 1.5},
                "agents": [{"id": f"a{i + 1}", "start_m": place} for i, place in enumerate(start)],
                "separation_min_m": 0.5,
                "communication_range_m": 2.5,
            },
            "control": {"period_s": 0.5, "horizon_steps": 12},
        }
    )


def steps_after_losing(index):
    """Return the controller, and the position and reason of each step after everyone saw everything at once."""
    mission = mission_in_a_row()
    law = RecedingHorizon(mission)
    position, velocity, told = np.array(START), np.zeros((3, 2)), []
    law.coverage.observe(0.0, position)
    assert law.coverage.complete
    law.set_lost(np.arange(3) == index)
    for step in range(12):
        result = law.step(position, velocity, 0.5 * step, deadline=None)
        told.append(result.reason)
        position, velocity = result.plan.position[1], result.plan.velocity[1]
    return law, position, told


def test_they_meet_and_then_stop():
    law, position, told = steps_after_losing(1)
    assert told[0] == "rendezvous"
    assert told[-1] == "all is covered"
    assert not out_of_range(position, law._constraints.fleet)
    np.testing.assert_allclose(position[1], START[1])


def test_whoever_is_still_in_touch_stays():
    _, position, told = steps_after_losing(2)
    assert set(told) == {"all is covered"}
    np.testing.assert_allclose(position, START)


def test_those_who_cannot_stop_in_time_meet_before_they_go_on():
    """Still in touch when the relay dies, but not by the time that they can have stopped."""
    position = np.array([[1.8, 1.0], [3.0, 1.8], [4.2, 1.0]])
    velocity = np.array([[-0.5, 0.0], [0.0, 0.0], [0.5, 0.0]])
    law = RecedingHorizon(mission_in_a_row(position.tolist(), radius=0.6))
    law.set_lost(np.array([False, True, False]))
    told, length = [], []
    for step in range(24):
        law.coverage.observe(0.5 * step, np.where([[True], [False], [True]], position, np.nan))
        result = law.step(position, velocity, 0.5 * step, deadline=None)
        told.append(result.reason)
        position, velocity = result.plan.position[1], result.plan.velocity[1]
        length.append(float(np.linalg.norm(position[2] - position[0])))
    assert told[0] == "rendezvous"
    met = next(n for n, value in enumerate(length) if value <= 2.5)
    assert max(length[met:]) <= 2.5 + 1e-6
    assert max(length) < 2.6
    assert told[-1] != "rendezvous"
