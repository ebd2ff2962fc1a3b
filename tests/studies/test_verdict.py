"""Everyone is judged alike: J exactly, what is covered, what holds at the samples and between them."""

from __future__ import annotations

import numpy as np
import pytest
from bench_missions import LIMITS, closed_mission, ended_mission, far_sighted_mission, small_mission

from mpc_cover.coverage.objective import coverage_cost
from mpc_cover.studies.case import asked_of_peers, make_case, start_from
from mpc_cover.studies.verdict import TOLERANCE, judge


def still(case):
    """Return the decision vector that stays at the start."""
    return start_from(case, "rest")


def test_a_fleet_at_rest_keeps_everything_and_covers_little():
    case = make_case(small_mission())
    found = judge(case, still(case))
    position, _ = case.ocp.motion(still(case))
    assert found.cost == pytest.approx(coverage_cost(position, case.ocp.cell, case.ocp.fleet.radius, case.ocp.weight))
    assert found.holds
    assert found.holds_sampled
    assert not found.complete
    assert found.separation_sampled == pytest.approx(0.6)
    assert found.separation_path == pytest.approx(0.6)
    assert 0.0 < found.covered_percent < 50.0


def test_what_sees_everything_and_keeps_everything_is_complete():
    case = make_case(far_sighted_mission())
    found = judge(case, still(case))
    assert (found.cost, found.covered_percent) == (0.0, 100.0)
    assert found.complete


def test_agents_that_pass_each_other_between_samples_are_too_close_on_the_path_only():
    case = make_case(small_mission(defaults={**LIMITS, "input_max_m_per_s2": 5.0}))
    velocity = np.zeros((case.ocp.steps + 1, 2, 2))
    velocity[1, :, 0], velocity[2, :, 0] = [1.1, -1.1], [0.7, -0.7]  # 0.45 m apart before and after they meet
    found = judge(case, case.ocp.decision(case.task.position, velocity))
    assert found.separation_sampled == pytest.approx(0.05)
    assert found.separation_path == pytest.approx(-0.4)
    assert found.sampled == 0.0
    assert found.path == pytest.approx(0.4)
    assert found.holds_sampled
    assert not found.holds
    assert found.worst.startswith("separation")


def test_limits_are_violations_at_samples_and_on_the_path():
    case = make_case(small_mission())
    velocity = np.zeros((case.ocp.steps + 1, 2, 2))
    velocity[1:-1, :, 1] = 1.0  # 0.5 m/s^2 too hard, and 1 m out of the box
    found = judge(case, case.ocp.decision(case.task.position, velocity))
    assert found.sampled == pytest.approx(1.0)
    assert found.path == pytest.approx(1.0)
    assert found.worst.startswith("box")


@pytest.mark.parametrize(
    ("mission", "words"), [(ended_mission, "end position"), (closed_mission, "closed in position")]
)
def test_the_end_that_a_mission_asks_for_is_judged(mission, words):
    case = make_case(mission())
    velocity = np.zeros((case.ocp.steps + 1, 2, 2))
    velocity[1:-1, :, 1] = 0.05
    found = judge(case, case.ocp.decision(case.task.position, velocity))
    assert words in found.worst
    assert found.sampled == pytest.approx(0.05 * 0.5 * (case.ocp.steps - 1) - TOLERANCE)


def test_numbers_that_are_not_finite_are_worth_nothing():
    case = make_case(small_mission())
    x = still(case)
    x[3] = np.nan
    found = judge(case, x)
    assert not found.holds_sampled
    assert not found.complete
    assert found.cost == np.inf


def test_a_single_agent_keeps_no_distances():
    case = make_case(small_mission(agents=[{"id": "a1", "start_m": [0.5, 0.5]}], separation_min_m=0.0))
    found = judge(case, still(case))
    assert found.separation_sampled is None
    assert found.separation_path is None
    assert found.holds


def test_peers_are_asked_for_no_more_room_than_the_start_has():
    roomy = asked_of_peers(make_case(small_mission()))
    assert roomy.separation == pytest.approx(0.4 + 0.01 + 3.0 * 0.25 / 8.0)
    assert roomy.range == pytest.approx(2.5 - 0.01 - 3.0 * 0.25 / 16.0)
    tight = asked_of_peers(make_case(small_mission(separation_min_m=0.98)))
    assert tight.separation == pytest.approx(1.0)
