"""The agent and its deadman: it flies its plans exactly, reports what it does, and always ends at rest."""

import numpy as np
import pytest
from service_fakes import straight_plan

from mpc_cover.clock import VirtualClock
from mpc_cover.service.agent.agent import Agent
from mpc_cover.service.agent.recorder import MemoryRecorder
from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.decoding import Reason
from mpc_cover.service.protocol.messages import PlanRef, encode


def test_it_reports_on_the_grid_of_its_own_clock(bench, agent):
    bench.run(seconds=1.0)
    states = bench.states()
    assert [state.seq for state in states] == list(range(len(states)))
    np.testing.assert_allclose([state.time_s for state in states[1:]], 100.0 + 0.1 * np.arange(11), atol=1e-9)
    assert all(state.at_rest and state.plan is None for state in states)
    assert agent.next_time == pytest.approx(101.1)


def test_it_flies_a_plan_from_its_start_to_its_end(bench, agent, send):
    plan = straight_plan(agent, 100.5)
    send(plan)
    bench.run(seconds=10.0)
    states = bench.states()
    waiting = [state for state in states if state.next_plan == plan.ref]
    flying = [state for state in states if state.plan == plan.ref]
    assert waiting[-1].time_s < 100.5 - 1e-6
    assert flying[0].time_s == pytest.approx(100.5)
    assert flying[-1].time_s == pytest.approx(104.4)
    assert not any(state.at_rest for state in waiting)
    assert states[-1].at_rest
    np.testing.assert_allclose(states[-1].position, plan.position[-1], atol=1e-12)
    assert not agent.rejected


def test_without_its_controller_it_ends_at_rest_within_its_plan(bench, agent, send):
    send(straight_plan(agent, 100.2))
    bench.run(seconds=60.0)
    assert agent.at_rest
    assert not agent.plant.velocity.any()
    assert not np.any(bench.states()[-1].velocity)


def test_a_newer_plan_takes_over_at_its_start(bench, agent, send):
    send(straight_plan(agent, 100.5))
    bench.run(seconds=0.6)
    newer = straight_plan(agent, 101.0, seq=1)
    send(newer)
    bench.run(seconds=10.0)
    assert not agent.rejected
    np.testing.assert_allclose(agent.plant.position, newer.position[-1], atol=1e-12)
    starts = [piece for piece in bench.records["a1"].pieces if piece.plan == newer.ref]
    assert starts[0].time_s == pytest.approx(101.0, abs=1e-9)


def test_a_late_plan_that_agrees_is_joined(bench, agent, send):
    plan = straight_plan(agent, 100.05)
    resting = dict.fromkeys(("velocity", "input"))
    resting["velocity"] = [[0.0, 0.0]] * 9
    resting["input"] = [[0.0, 0.0]] * 8
    bench.run(seconds=0.2)
    send(straight_plan(agent, 100.05, position=[plan.position[0]] * 9, **resting))
    assert not agent.rejected
    assert agent.schedule.flown.ref == PlanRef(1, 0)


def test_a_late_plan_that_is_elsewhere_by_now_is_not(bench, agent, send):
    plan = straight_plan(agent, 100.05)
    bench.run(seconds=0.4)
    send(plan)
    assert agent.rejected == {Reason.START: 1}
    assert agent.at_rest


def test_a_flood_of_bad_plans_is_told_once_a_second(bench, agent):
    publisher = bench.bus.join().publisher(bench.keys.plan("a1"), bus.PLAN)
    for _ in range(19):
        publisher.publish(b"{")
        publisher.publish(b"{")
        bench.run(seconds=0.1)
    assert agent.rejected == {Reason.MALFORMED: 38}
    assert len(bench.events()) == 2


def test_another_machine_has_another_clock(bench, send):
    """Everything an agent says and is told is in its own time."""
    other = VirtualClock(7.0)
    agent = bench.agent("a2", clock=other)
    assert bench.states("a2")[0].time_s == 7.0
    bench.agents.remove(agent)
    bench.bus.join().publisher(bench.keys.plan("a2"), bus.PLAN).publish(encode(straight_plan(agent, 7.5)))
    agent.tick()
    assert agent.schedule.queue[0].motion.start_time == 7.5


def test_the_record_ends_with_the_last_state(bench, agent, send):
    send(straight_plan(agent, 100.5))
    bench.run(seconds=1.0)
    agent.shutdown()
    last = bench.records["a1"].pieces[-1]
    assert last.time_s == bench.clock.now()
    assert last.position == agent.plant.position.tolist()
    assert last.velocity[1] > 0.0


def test_an_agent_that_is_told_where_it_stands_is_there_and_not_at_the_missions_start(bench):
    stands = np.array([1.25, 2.5])
    recorder = MemoryRecorder()
    agent = Agent(bench.mission, "a1", bench.bus.join(), bench.clock, recorder=recorder, place=stands)
    agent.startup()
    assert bench.states()[-1].position == pytest.approx(stands)
    assert recorder.pieces[0].position == pytest.approx(stands)
