"""What agents tell each other of looks and readings makes the map that one who saw it all would have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mission_kinds import KINDS, mission_with

from mpc_cover.distributed.delayed_measurements import DelayedMeasurements
from mpc_cover.distributed.setup import make_agent
from mpc_cover.distributed.state_report import StateReport
from mpc_cover.information.build import sensor_of, settling_map
from mpc_cover.information.visibility import Visibility

KALMAN = mission_with(KINDS["kalman"])
REST = np.zeros(2)


def report(agent=0, sample=0, where=(1.0, 1.0), readings=None):
    at = np.array(where)
    return StateReport(agent, sample, 0.5 * sample, at, REST, looked=at, looked_s=0.5 * sample, readings=readings)


def known(mission=KALMAN):
    sight = Visibility(mission.field, mission.fleet.radius)
    own = settling_map(mission, sight)
    return own, DelayedMeasurements(own, sight, 0, reads=sensor_of(mission, sight) is not sight), sight


@pytest.mark.parametrize("kind", ["looks", "effective", "kalman"])
def test_two_agents_that_hear_each_other_know_what_a_witness_knows(kind):
    mission = mission_with(KINDS[kind])
    agents = [make_agent(mission, index, seed=3) for index in range(2)]
    sight = Visibility(mission.field, mission.fleet.radius)
    sensor, witness = sensor_of(mission, sight), settling_map(mission, sight)
    for sample in range(8):
        position = mission.fleet.start + 0.2 * sample
        own = [each.report(sample, 0.5 * sample, q, REST) for each, q in zip(agents, position, strict=True)]
        agents[0].receive([own[1]])
        agents[1].receive([own[0]])
        witness.take(sensor.looks(0.5 * sample, position))
    for each in agents:
        for name, array in witness.kept.items():
            if name != "done_at":
                np.testing.assert_allclose(each.known.kept[name], array, rtol=1e-12)
        np.testing.assert_array_equal(each.known.owed, witness.owed)
    assert not witness.complete
    assert (witness.residual < settling_map(mission, sight).residual).any()


@pytest.mark.parametrize("readings", [None, np.array([]), np.array([1.0]), np.ones(999)])
def test_looks_without_their_readings_are_not_counted(readings):
    own, looks, _ = known()
    looks.take(report(readings=readings))
    assert (own.residual == own.residual.max()).all()


def test_looks_with_their_readings_are():
    own, looks, sight = known()
    seen = sight.looks(0.0, np.array([[1.0, 1.0]]), np.array([0]))
    looks.take(report(readings=np.full(seen.count, 2.0)))
    estimate = own.estimate.reshape(-1)
    np.testing.assert_allclose(estimate[seen.place], 2.0 * 4.0 / 5.0)  # P(0) = 4, R = 1
    assert not np.delete(estimate, seen.place).any()


def test_readings_that_come_twice_count_once():
    one = make_agent(KALMAN, 1, seed=0)
    said = make_agent(KALMAN, 0, seed=0).report(0, 0.0, KALMAN.fleet.start[0], REST)
    one.receive([said])
    before = one.known.information.copy()
    one.receive([said, replace(said)])
    np.testing.assert_array_equal(one.known.information, before)
    assert said.readings is not None
    assert said.readings.size > 0
