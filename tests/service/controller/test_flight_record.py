"""The controller's own record of a flight is what the agents recorded themselves."""

import numpy as np
import pytest
from service_fakes import Bench, small_mission
from sweep_laws import StraightSweepLaw

from mpc_cover.service.agent.recorder import MemoryRecorder
from mpc_cover.service.protocol.messages import CommandRequest, encode
from mpc_cover.service.run.recording import merge
from mpc_cover.verification.check import check_trajectory


def fly(mission, channel=None, pause=False):
    """Return what the agents recorded, and what the controller did."""
    bench = Bench(mission, channel)
    for name in mission.fleet.ids:
        bench.agent(name)
    own = [MemoryRecorder() for _ in mission.fleet.ids]
    controller = bench.controller(StraightSweepLaw(mission, goal_y=3.5), recorders=own)
    if pause:
        bench.run(controller, until=lambda: controller.mission_time_s > 1.7)
        for number, command in enumerate(("pause", "resume")):
            bench.bus.join().post(bench.keys.command(command), encode(CommandRequest(request=f"r{number}")))
            bench.run(controller, seconds=4.0)
    bench.run(controller, until=lambda: controller.done)
    controller.shutdown()
    for agent in bench.agents:
        agent.shutdown()
    theirs = [bench.records[name].pieces for name in mission.fleet.ids]
    return merge(mission, theirs, {}), merge(mission, [record.pieces for record in own], {})


@pytest.mark.parametrize("pause", [False, True])
def test_it_is_what_the_agents_flew(mission, pause):
    theirs, own = fly(mission, pause=pause)
    assert check_trajectory(own).holds
    np.testing.assert_allclose(own.covered_at, theirs.covered_at, atol=1e-6)
    position, velocity = theirs.at(own.time)
    np.testing.assert_allclose(own.position, position, atol=1e-9)
    np.testing.assert_allclose(own.velocity, velocity, atol=1e-9)


def test_lost_reports_leave_no_gap(mission):
    random = np.random.default_rng(3)

    def channel(key, payload):
        return [] if key.endswith("/state") and random.random() < 0.3 else [payload]

    theirs, own = fly(mission, channel)
    position, _ = theirs.at(own.time)
    np.testing.assert_allclose(own.position, position, atol=1e-6)


def test_of_disturbed_agents_it_is_the_reference():
    mission = small_mission(disturbance={"position_noise_m": 0.01, "input_noise_m_per_s2": 0.02})
    theirs, own = fly(mission)
    position, _ = theirs.at(own.time)
    np.testing.assert_allclose(own.position, position, atol=0.2)


def test_the_gap_of_an_agent_that_was_started_again_is_its_braking(mission):
    """It stands where its vehicle came to rest."""
    bench = Bench(mission)
    _, second = bench.agent("a1"), bench.agent("a2")
    own = [MemoryRecorder() for _ in mission.fleet.ids]
    controller = bench.controller(StraightSweepLaw(mission, goal_y=3.5), recorders=own)
    bench.run(controller, until=lambda: controller.mission_time_s > 1.2)
    assert np.linalg.norm(second.plant.velocity) > 0.1
    assert "a2" not in controller.fleet_monitor.standing(bench.clock.now()), "it flies"
    bench.kill(second)
    bench.run(controller, seconds=0.5)
    place, left_s = controller.fleet_monitor.standing(bench.clock.now())["a2"]
    assert 0.0 < left_s <= 1.0
    bench.run(controller, seconds=1.0)
    assert controller.fleet_monitor.standing(bench.clock.now())["a2"] == (place, 0.0)
    bench.agent("a2", instance="a2-again", place=place)
    bench.run(controller, until=lambda: controller.done)
    controller.shutdown()
    assert check_trajectory(merge(mission, [record.pieces for record in own], {})).holds
