"""Agreeing on a start with nobody in charge."""

from threading import Event

import pytest
from swarm_missions import swarm_mission

from mpc_cover.clock import VirtualClock
from mpc_cover.service.protocol.bus import Quality
from mpc_cover.service.protocol.local import LocalBus
from mpc_cover.service.swarm.agent import SwarmAgent

HISTORYLESS = Quality("DATA")


class Ground:
    """Agents that wait on one bus; time passes tick by tick."""

    def __init__(self, mission):
        self.mission, self.clock, self.said, self.agents = mission, VirtualClock(10.0), [], []
        self.bus = LocalBus(self.clock)

    def add(self, name, mission=None, **options):
        agent = SwarmAgent(mission or self.mission, name, self.bus.join(), self.clock, say=self.said.append, **options)
        agent.startup()
        self.agents.append(agent)
        return agent

    def wait(self, seconds):
        until = self.clock.now() + seconds
        while flying := [agent for agent in self.agents if not agent.done]:
            due = min(flying, key=lambda agent: agent.next_time)
            if due.next_time > until:
                break
            self.clock.wait_until(due.next_time, Event())
            due.tick()
        self.clock.wait_until(until, Event())

    def heard(self, text):
        return any(text in said for said in self.said)


@pytest.fixture
def ground():
    return Ground(swarm_mission())


def test_nobody_begins_before_all_are_there_and_then_all_at_once(ground):
    first, second = ground.add("a1"), ground.add("a2")
    ground.wait(5.0)
    assert first.start_s == second.start_s == float("inf")
    third = ground.add("a3")
    ground.wait(5.0)
    assert first.start_s == second.start_s == third.start_s < ground.clock.now()


def test_word_gets_round_a_chain_in_which_the_ends_do_not_hear_each_other():
    chain = [{"id": f"a{i + 1}", "start_m": [1.0 + 3.0 * i, 1.0]} for i in range(4)]
    ground = Ground(swarm_mission(size=12.0, fleet={"agents": chain}))
    agents = [ground.add(f"a{i + 1}") for i in (3, 1, 0, 2)]
    ground.wait(8.0)
    assert len({agent.start_s for agent in agents}) == 1
    assert agents[0].start_s < ground.clock.now()


@pytest.mark.parametrize("speed", [0.2, 1.0, 20.0])
def test_all_begin_in_time_however_fast_the_clock_is(speed):
    ground = Ground(swarm_mission())
    for name in ("a1", "a2", "a3"):
        ground.add(name, speed=speed)
        ground.wait(0.037 * speed)
    ground.wait(4.0 * speed + 2.0)
    assert all(agent.exit_status != 1 for agent in ground.agents)
    assert len({agent.start_s for agent in ground.agents}) == 1
    assert ground.agents[0].start_s < ground.clock.now()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"seed": 9}, "--seed 9"),
        ({"speed": 2.0}, "--speed 2"),
        ({"mission": swarm_mission(size=6.0)}, "its mission is another one"),
    ],
)
def test_who_does_not_fit_is_not_waited_with(ground, options, message):
    for name in ("a1", "a2"):
        ground.add(name)
    ground.add("a3", **options)
    ground.wait(3.0)
    assert ground.heard(message)
    assert all(agent.start_s == float("inf") for agent in ground.agents)


def test_a_name_that_is_taken_is_told(ground):
    ground.add("a1")
    ground.add("a1")
    ground.wait(1.0)
    assert ground.heard("another process says that it is a1, too")


def test_who_comes_when_the_others_fly_gives_up(ground):
    for name in ("a1", "a2", "a3"):
        ground.add(name)
    ground.wait(8.0)
    late = ground.add("a3", instance="again")
    ground.wait(2.0)
    assert late.done
    assert late.exit_status == 1
    assert ground.heard("this agent has come too late")


def test_nonsense_is_counted_and_harmless(ground):
    agents = [ground.add(name) for name in ("a1", "a2", "a3")]
    stranger = ground.bus.join()
    for key in ("hello", "word"):
        for payload in (b"", b"{}", b'{"schema": 99}', b"[" * 5000, b'{"schema": 1, "agent": "a1"}'):
            stranger.publisher(f"cover/swarm/agent/a2/{key}", HISTORYLESS).publish(payload)
    ground.wait(6.0)
    assert all(agent.start_s < ground.clock.now() for agent in agents)
    for payload in (b"", b"{}"):
        stranger.publisher("cover/swarm/agent/a2/word", HISTORYLESS).publish(payload)
    ground.wait(1.0)
    assert sum(agents[0].rejected.values()) >= 2
    assert agents[0].exit_status is None
