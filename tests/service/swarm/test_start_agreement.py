"""Agreeing on a start with nobody in charge."""

import pytest
from swarm_ground import Ground
from swarm_missions import swarm_mission


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
