"""A plan that an agent turned away is not what the next one starts from."""

import numpy as np
import pytest
from service_fakes import Bench, small_mission, straight_plan

from mpc_cover.model.trajectory import Trajectory
from mpc_cover.service.controller.fleet_monitor import FleetMonitor
from mpc_cover.service.controller.plan_publisher import PlanPublisher
from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.decoding import Reason
from mpc_cover.service.protocol.messages import encode

PERIOD = 0.5


@pytest.fixture
def bench():
    """As slow to look at its mail as may be: once a period."""
    return Bench(small_mission(state_period_s=PERIOD))


def plan_from(start, up):
    """Return a plan of (m, d) positions at rest that goes up for a while [m/s], from 100.5 s on."""
    later = np.zeros((8, *start.shape))
    later[:4, :, 1] = up
    return Trajectory.from_velocities(start, np.zeros_like(start), later, 100.5, PERIOD)


def test_an_agent_tells_what_it_turned_away_until_it_takes_up_another(bench):
    agent = bench.agent("a1")
    publisher = bench.bus.join().publisher(bench.keys.plan("a1"), bus.PLAN)
    wrong = straight_plan(agent, 101.0, velocity=[[0.0, 9.0]] * 9)
    publisher.publish(encode(wrong))
    bench.run(seconds=PERIOD)
    assert bench.states()[-1].refused == wrong.ref
    publisher.publish(encode(straight_plan(agent, 101.0, seq=1)))
    bench.run(seconds=PERIOD)
    assert bench.states()[-1].refused is None
    assert agent.rejected == {Reason.LIMITS: 1}


@pytest.mark.parametrize(("off_m", "taken"), [(0.0, True), (0.3, False)])
def test_where_it_will_be_is_told_without_the_plan_that_it_turned_away(bench, off_m, taken):
    agents = [bench.agent("a1"), bench.agent("a2")]
    plan_publisher = PlanPublisher(bench.mission, bench.bus.join(), 1, "controller")
    fleet = FleetMonitor(bench.mission, bench.bus.join())
    bench.run(seconds=0.0)
    fleet.receive()
    plan_publisher.send(plan_from(bench.mission.fleet.start + off_m, 0.2), fleet.links, 0.0, bench.clock.now())
    bench.run(seconds=PERIOD)
    fleet.receive()
    flown = [plan_publisher.schedule(index, link).flying(101.0) for index, link in enumerate(fleet.links)]
    queued = [plan_publisher.schedule(index, link).queue for index, link in enumerate(fleet.links)]
    assert all(agent.rejected[Reason.START] == (not taken) for agent in agents)
    assert all((flight is not None or bool(waiting)) == taken for flight, waiting in zip(flown, queued, strict=True))
