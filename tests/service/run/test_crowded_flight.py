"""Fleets whose range is hardly longer than their separation move at once, and cover as a line abreast might."""

import numpy as np
import pytest

from mpc_cover.mission.load import build_mission
from mpc_cover.planning.offline import PlanOptions, plan_mission
from mpc_cover.service.run.simulate import simulate
from mpc_cover.verification.check import check_trajectory

LINE = [(1.0 + 0.55 * i, 1.0) for i in range(3)]
BLOCK = [(1.0 + 0.55 * i, 1.0 + 0.55 * j) for i in range(2) for j in range(2)]
SIDES, RADIUS, APART, SPEED = (6.0, 4.0), 0.5, 0.5, 1.0


def crowded(starts, reach, **planning):
    agents = [{"id": f"a{i + 1}", "start_m": list(start)} for i, start in enumerate(starts)]
    raw = {
        "schema": 1,
        "name": "crowded",
        "area": {"shape": {"kind": "box", "min_m": [0, 0], "max_m": list(SIDES)}, "cell_size_m": 0.25},
        "fleet": {
            "defaults": {"sensing_radius_m": RADIUS, "input_max_m_per_s2": 1.0, "speed_max_m_per_s": SPEED},
            "agents": agents,
            "separation_min_m": APART,
            "communication_range_m": reach,
        },
        "control": {"period_s": 0.5, "horizon_steps": 10, "planning_time_s": 1.0},
        "planning": planning,
    }
    return build_mission(raw, "crowded")


def line_bound(agents, reach):
    """Return the time [s] in which a line abreast, as wide as its links allow, sweeps as much as the area."""
    return SIDES[0] * SIDES[1] / (SPEED * ((agents - 1) * reach + 2.0 * RADIUS))


@pytest.mark.parametrize(
    ("starts", "reach"), [(LINE, 0.6), (LINE, 0.56), (BLOCK, 0.6)], ids=["line", "hardly any room", "block"]
)
def test_a_crowd_flies_in_formation_from_the_first_plan_on(starts, reach):
    mission = crowded(starts, reach)
    result = simulate(mission)
    assert result.complete
    assert check_trajectory(result.trajectory).holds
    covered = np.sort(result.trajectory.covered_at)
    assert covered[int(np.ceil(0.99 * covered.size)) - 1] <= 2.0 * line_bound(len(starts), reach)
    moved = np.abs(result.trajectory.velocity).max(axis=(1, 2)) > 0.0
    assert result.trajectory.time[np.argmax(moved)] < 1.0  # not after one fruitless search after another


@pytest.mark.parametrize(("starts", "reach"), [(LINE, 0.56), (BLOCK, 0.56)], ids=["line", "block"])
def test_a_plan_of_a_crowd_does_not_stay_where_it_is(starts, reach):
    mission = crowded(starts, reach, duration_s=8.0)
    plan = plan_mission(mission, PlanOptions(starts=3, time_limit_s=4.0))
    assert np.isfinite(plan.covered_at).mean() > 0.5
    assert check_trajectory(plan).holds
