"""What is sent is what the safety filter admits; what an agent turned away is not what the next plan starts from."""

import numpy as np
import pytest
from service_fakes import Bench, small_mission, straight_plan
from sweep_laws import FAULTS

from mpc_cover.model.fleet_state import FleetState
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.service.controller.fleet_monitor import FleetMonitor
from mpc_cover.service.controller.plan_publisher import PlanPublisher, UnknownPlanError
from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.decoding import Reason
from mpc_cover.service.protocol.messages import encode

PERIOD = 0.5


class Ground:
    """Two agents at rest that look at their mail once a period, and a publisher that knows their states."""

    def __init__(self):
        self.bench = Bench(small_mission(state_period_s=PERIOD))
        self.agents = [self.bench.agent("a1"), self.bench.agent("a2")]
        self.publisher = PlanPublisher(self.bench.mission, self.bench.bus.join(), 1, "controller")
        self.fleet = FleetMonitor(self.bench.mission, self.bench.bus.join())
        self.wait(0.0)

    def wait(self, seconds):
        self.bench.run(seconds=seconds)
        self.fleet.receive()

    def at_rest(self, off_m=0.0, start_s=100.5):
        """Return the state of a fleet that rests so far from where it starts."""
        start = self.bench.mission.fleet.start + off_m
        return FleetState.nominal(start, np.zeros_like(start), start_s)

    def plan(self, state, up):
        """Return a plan that goes up for a while [m/s]."""
        later = np.zeros((8, *state.position.shape))
        later[:4, :, 1] = up
        return state.trajectory(later, PERIOD)

    def publish(self, trajectory, state):
        return self.publisher.publish(trajectory, state, self.fleet.links, 0.0, self.bench.clock.now())

    def schedules(self):
        return [self.publisher.schedule(index, link) for index, link in enumerate(self.fleet.links)]


@pytest.fixture
def ground():
    return Ground()


def test_each_agent_is_sent_its_own_part_in_its_own_clock(ground):
    ground.fleet.freeze_clocks()
    state = ground.at_rest()
    trajectory = ground.plan(state, 0.2)
    verdict = ground.publish(trajectory, state)
    assert verdict.admitted
    for index, name in enumerate(ground.bench.mission.fleet.ids):
        (plan,) = ground.bench.plans(name)
        assert (plan.agent, plan.instance, plan.seq, plan.epoch) == (name, f"{name}-life", 0, 1)
        assert plan.start_s == pytest.approx(100.5 - ground.fleet.links[index].offset)
        assert plan.valid_until_s == pytest.approx(plan.start_s + PERIOD)
        np.testing.assert_array_equal(plan.position, trajectory.position[:, index])


@pytest.mark.parametrize("fault", FAULTS)
def test_nothing_is_sent_of_what_is_refused_and_it_leaves_no_trace(ground, fault):
    state = ground.at_rest()
    good = ground.plan(state, 0.2)
    change, words = FAULTS[fault]
    verdict = ground.publish(change(good, state), state)
    assert not verdict.admitted
    assert words in verdict.reason
    assert not ground.bench.plans("a1")
    assert not ground.bench.plans("a2")
    assert not any(schedule.queue for schedule in ground.schedules())
    assert ground.publish(good, state).admitted
    assert [plan.seq for plan in ground.bench.plans("a1")] == [0]


def test_an_agent_tells_what_it_turned_away_until_it_takes_up_another(ground):
    bench, agent = ground.bench, ground.agents[0]
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
def test_where_it_will_be_is_told_without_the_plan_that_it_turned_away(ground, off_m, taken):
    """The controller may be wrong about where they are: they are not where the plan starts."""
    state = ground.at_rest(off_m)
    assert ground.publish(ground.plan(state, 0.2), state).admitted
    ground.wait(PERIOD)
    flown = [schedule.flying(101.0) for schedule in ground.schedules()]
    queued = [schedule.queue for schedule in ground.schedules()]
    assert all(agent.rejected[Reason.START] == (not taken) for agent in ground.agents)
    assert all((flight is not None or bool(waiting)) == taken for flight, waiting in zip(flown, queued, strict=True))


def test_who_is_lost_is_sent_nothing(ground):
    state = ground.at_rest()
    lost = FleetState(state.position, state.velocity, state.time, np.array([False, True]), state.speed_share)
    assert ground.publish(ground.plan(state, 0.2), lost).admitted
    assert len(ground.bench.plans("a1")) == 1
    assert not ground.bench.plans("a2")


def held(ground, time_s):
    return [plan.ref.seq for plan in ground.publisher.may_fly(0, ground.fleet.links[0], time_s)]


def test_what_was_sent_may_be_flown_until_a_report_tells(ground):
    state = ground.at_rest()
    assert ground.publish(ground.plan(state, 0.2), state).admitted
    assert held(ground, 101.0) == [0]  # nobody has told yet: it, or rest
    ground.wait(PERIOD)
    assert held(ground, 101.0) == [0]
    later = FleetState.nominal(*ground.plan(state, 0.2).at(101.0), 101.0)
    assert ground.publish(ground.plan(later, 0.1), later).admitted
    assert held(ground, 101.0) == [0, 1]
    ground.wait(PERIOD)
    assert held(ground, 101.5) == [1], "it has the second one, and switches to it by itself"


def test_what_an_agent_turned_away_or_heard_too_late_is_not_flown(ground):
    state = ground.at_rest(0.3)
    assert ground.publish(ground.plan(state, 0.2), state).admitted
    ground.wait(PERIOD)
    assert held(ground, 101.0) == []


def test_a_plan_of_another_controller_is_unknown(ground):
    stranger = ground.bench.bus.join().publisher(ground.bench.keys.plan("a2"), bus.PLAN)
    stranger.publish(encode(straight_plan(ground.agents[1], 100.5, epoch=7, controller="other")))
    ground.wait(1.0)
    with pytest.raises(UnknownPlanError, match="epoch 7, plan 0"):
        ground.schedules()


def test_an_agent_in_whose_place_there_is_another_flies_nothing_of_what_was_sent(ground):
    state = ground.at_rest()
    assert ground.publish(ground.plan(state, 0.2), state).admitted
    ground.publisher.forget(1)
    first, second = ground.schedules()
    assert first.queue
    assert not second.queue


def test_later_plans_are_held_to_no_more_than_the_last_one_sent_attains(ground):
    """Out of the box already, a fleet may fly on as it was admitted to; further out it may not."""
    state = ground.at_rest()
    assert ground.publish(ground.plan(state, 0.2), state).admitted
    below = state.position + np.array([0.0, -0.6])
    outside = FleetState.nominal(below, np.zeros_like(below), 101.0)
    still = Trajectory.at_rest(below, 101.0, PERIOD, 8)
    assert ground.publish(still, outside).admitted
    refused = ground.publish(ground.plan(outside, -0.2), outside)
    assert not refused.admitted
    assert "box" in refused.reason
    assert ground.publish(ground.plan(outside, 0.2), outside).admitted
