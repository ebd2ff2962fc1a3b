"""Work that lies many horizons away, and agents that turn out to be slow, in the closed loop."""

import numpy as np
import pytest

from mpc_cover.mission.load import build_mission
from mpc_cover.service.run.simulate import simulate
from mpc_cover.verification.check import check_trajectory
from mpc_cover.verification.hovering import hovering_of


def flown(size, starts, fleet=None, values=None, **more):
    """Return the flight of a mission on a box, with the weights of its cells as rows along x."""
    raw = {
        "schema": 1,
        "name": "far",
        "area": {"shape": {"kind": "box", "min_m": [0, 0], "max_m": size}, "cell_size_m": 1.0},
        "fleet": {
            "defaults": {"sensing_radius_m": 1.0, "input_max_m_per_s2": 1.5, "speed_max_m_per_s": 1.5},
            "agents": [
                {"id": f"a{i + 1}", "start_m": start} | more.pop(f"a{i + 1}", {}) for i, start in enumerate(starts)
            ],
            "separation_min_m": 0.4,
            **(fleet or {}),
        },
        "control": {"period_s": 0.5, "horizon_steps": 8, "planning_time_s": 2.0},
    }
    if values is not None:
        raw["area"]["weights"] = {"values": values}
    result = simulate(build_mission(raw | more, "far"))
    assert result.complete
    assert check_trajectory(result.trajectory).holds
    return result.trajectory


@pytest.mark.parametrize("reach", [None, 2.5])
def test_a_corner_left_over_far_away_is_flown_to_at_once(reach):
    """Ten horizons away: the fleet neither hovers nor creeps."""
    values = [[1.0, 1.0, 1.0]] * 4 + [[0.0, 0.0, 0.0]] * 75 + [[0.0, 0.0, 1.0]]
    fleet = {} if reach is None else {"communication_range_m": reach}
    record = flown([80, 3], [[1, 1], [2, 2]], fleet, values)
    assert hovering_of(record).events == 0
    assert float(record.covered_at.max()) < 1.3 * 78.0 / 1.5


def test_what_is_learnt_in_flight_is_worth_what_was_stated():
    starts = [[1, 1], [2, 1], [1, 2], [2, 2]]
    stated = flown([11, 11], starts, a2={"speed_max_m_per_s": 0.45})
    learnt = flown([11, 11], starts, disturbance={"slow_agents": {"a2": 0.3}})
    assert np.max(learnt.covered_at) < 1.25 * np.max(stated.covered_at)
    assert hovering_of(learnt).seconds.sum() < 4.0
