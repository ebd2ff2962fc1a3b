"""Narrow areas in the closed loop: work is shared out along the shape, after a death too, and little is left behind."""

from __future__ import annotations

import numpy as np
import pytest

from mpc_cover.mission.load import build_mission
from mpc_cover.service.run.simulate import simulate

RING = {
    "kind": "polygon",
    "outline_m": [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]],
    "holes_m": [[[2.0, 2.0], [8.0, 2.0], [8.0, 8.0], [2.0, 8.0]]],
}
COMB = {
    "kind": "polygon",
    "outline_m": [[0, 0], [16, 0], [16, 1], [1, 1], [1, 4], [16, 4], [16, 5], [1, 5], [1, 8], [16, 8], [16, 9], [0, 9]],
}
START = [[1.0, 1.0], [3.0, 1.0], [1.0, 3.0]]


def mission_on(shape, start):
    return build_mission(
        {
            "schema": 1,
            "name": "narrow",
            "area": {"shape": shape, "cell_size_m": 0.5},
            "fleet": {
                "defaults": {"sensing_radius_m": 1.0, "input_max_m_per_s2": 1.5, "speed_max_m_per_s": 1.5},
                "agents": [{"id": f"a{i + 1}", "start_m": place} for i, place in enumerate(start)],
                "separation_min_m": 0.5,
            },
            "control": {"period_s": 0.5, "horizon_steps": 20, "planning_time_s": 3.0},
        },
        "narrow",
    )


def times(mission, **options):
    """Return the times to 99 % and to 100 % [s]."""
    covered = np.sort(simulate(mission, **options).trajectory.covered_at)
    return covered[int(np.ceil(0.99 * covered.size)) - 1], covered[-1]


def test_a_ring_is_divided_among_those_who_fly():
    """Whoever has the farthest third flies 12 m to it and 8 m along it, at 1.5 m/s."""
    most, everything = times(mission_on(RING, START))
    assert most <= 10.5
    assert everything <= 1.15 * most


def test_after_a_death_the_rest_of_a_ring_is_divided_anew():
    """Sweeps of the bounding box took 22 s."""
    most, everything = times(mission_on(RING, START), deaths={"a2": 3.0})
    assert most <= 16.0
    assert everything <= 1.15 * most


@pytest.mark.slow
def test_in_lanes_both_work():
    """One lane takes 10 s, all three and the ways between them 35 s for one alone."""
    most, everything = times(mission_on(COMB, [[0.5, 0.5], [2.0, 0.5]]))
    assert most <= 23.0
    assert everything <= 1.15 * most
