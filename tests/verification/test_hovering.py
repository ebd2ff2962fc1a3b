"""Hovering is rest in spite of something owed that one could have measured before anybody did, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from flights import leg, trajectory_of

from mpc_cover.mission.load import build_mission
from mpc_cover.verification.check import check_trajectory
from mpc_cover.verification.hovering import hovering_of
from mpc_cover.verification.summary import summarise

PERIOD, TURN_S = 0.5, 2.0
"""[s]; of agents with v_max = u_max."""


def strip(*starts_m, **changes):
    """Return a strip of 30 m to be measured by agents that start somewhere on its axis [m]."""
    agents = [{"id": f"a{i + 1}", "start_m": [x, y]} for i, (x, y) in enumerate(starts_m)]
    defaults = {"sensing_radius_m": 1.5, "input_max_m_per_s2": 1.5, "speed_max_m_per_s": 1.5}
    raw = {
        "schema": 1,
        "name": "strip",
        "area": {"shape": {"kind": "box", "min_m": [0, 0], "max_m": [30, 2]}, "cell_size_m": 1.0},
        "fleet": {"defaults": defaults, "agents": agents, **changes.pop("fleet", {})},
        "control": {"period_s": PERIOD},
    }
    return build_mission(raw | changes, "strip")


def flight(mission, *displacement_m, waits=0):
    """Return a flight in which agents wait so many periods, and then move along the strip, at full speed."""
    moves = leg(np.array([[x, 0.0] for x in displacement_m]), PERIOD, 2, int(max(displacement_m) / 0.75) - 2)
    return trajectory_of(mission, np.concatenate([np.zeros((waits, *moves.shape[1:])), moves]))


@pytest.mark.parametrize("waits", [0, 2, 20, 60])
def test_waiting_before_the_work_is_hovering_but_for_the_time_to_turn(waits):
    record = flight(strip((1.0, 1.0)), 28.0, waits=waits)
    hovering = hovering_of(record)
    assert hovering.seconds.sum() == pytest.approx(max(waits * PERIOD - TURN_S, 0.0), abs=2 * PERIOD)
    assert hovering.events == (waits * PERIOD > TURN_S)


def test_who_waits_behind_the_others_does_not_hover():
    record = flight(strip((1.0, 1.0), (1.0, 0.0)), 28.0, 0.0)
    assert np.isfinite(record.covered_at).all()
    assert hovering_of(record).events == 0


def test_who_is_nearer_to_the_rest_than_those_who_measure_it_hovers():
    record = flight(strip((1.0, 1.0), (29.0, 1.0)), 26.0, 0.0)
    assert hovering_of(record).seconds.tolist() == pytest.approx([0.0, 14.0], abs=5.0)


def test_a_slow_agent_hovers_only_by_its_own_measure():
    fast = flight(strip((1.0, 1.0), (28.5, 1.0)), 25.0, 0.0)
    slow = strip((1.0, 1.0), (28.5, 1.0), disturbance={"slow_agents": {"a2": 0.01}})
    assert hovering_of(fast).events == 1
    assert hovering_of(replace(fast, mission=slow)).events == 0


def test_a_relay_does_not_hover_while_somebody_is_on_the_way():
    """Within its range of nobody else: it has to stay."""
    near = {"communication_range_m": 4.0}
    mission = strip((15.0, 1.0), (12.0, 1.0), fleet=near)
    there = flight(mission, 13.0, 0.0)
    assert hovering_of(there).seconds[1] < hovering_of(replace(there, mission=strip((15, 1), (12, 1)))).seconds[1]


def test_what_is_never_measured_counts_to_the_end_unless_nobody_can_reach_it():
    mission = strip((1.0, 1.0))
    record = trajectory_of(mission, np.zeros((60, 1, 2)))
    assert hovering_of(record).seconds.sum() > 10.0
    walled = strip((1.0, 1.0))
    fleet = replace(walled.fleet, motion_max=np.array([2.0, 2.0]))
    covered = np.where(walled.field.cell[:, 0] <= 3.5, 0.0, np.inf)
    assert hovering_of(replace(record, mission=replace(walled, fleet=fleet), covered_at=covered)).events == 0


def test_the_summary_tells_it_and_leaves_it_out_where_looks_are_many():
    record = flight(strip((1.0, 1.0)), 28.0, waits=20)
    summary = summarise(record, check_trajectory(record)).to_dict()
    assert summary["hovering_agent_s"] == pytest.approx(8.0, abs=2 * PERIOD)
    assert summary["hovering_events"] == 1
    many = flight(strip((1.0, 1.0), information={"kind": "looks", "looks": 3}), 28.0, waits=20)
    assert summarise(many, check_trajectory(many)).hovering_agent_s is None


def test_an_agent_that_is_lost_does_not_hover():
    record = flight(strip((1.0, 1.0), (29.0, 1.0)), 26.0, 0.0)
    assert hovering_of(replace(record, meta={**record.meta, "lost": {"a2": 0.0}})).events == 0
