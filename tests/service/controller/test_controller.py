"""The controller's tick: its phases, the grid, and what it does when others fail."""

from collections import Counter
from threading import Event

import numpy as np
import pytest
from service_fakes import Bench, CheckpointsInMemory, small_mission
from sweep_laws import FAULTS, FaultyLaw, SharingLaw, StraightSweepLaw, ThoughtfulLaw

from mpc_cover.clock import VirtualClock
from mpc_cover.planning.budget import Budget
from mpc_cover.service.protocol.decoding import Reason
from mpc_cover.service.protocol.messages import CommandRequest, Phase, encode


def flying(controller):
    return lambda: controller.phase is Phase.FLYING


def test_a_mission_from_waiting_to_everyone_at_rest(bench, fleet, law):
    controller = bench.controller(law)
    phases = []
    bench.run(controller, until=lambda: controller.done, after=lambda _: phases.append(controller.phase))
    assert list(dict.fromkeys(phases)) == [Phase.WAITING, Phase.PLANNING, Phase.FLYING, Phase.COMPLETE]
    assert controller.exit_status == 0
    assert controller.coverage.complete
    assert all(agent.at_rest for agent in fleet)
    assert not Counter(agent.rejected for agent in fleet if agent.rejected)
    assert not controller.fleet_monitor.rejected


def test_it_waits_for_every_agent_and_says_for_whom(bench, law):
    bench.agent("a1")
    controller = bench.controller(law)
    bench.run(controller, seconds=3.0)
    assert controller.phase is Phase.WAITING
    assert controller.heartbeat.text == "a2 is not here"
    assert not law.states
    bench.agent("a2")
    bench.run(controller, until=flying(controller))


def test_the_status_says_planning_before_the_planning(bench, fleet, law):
    seen = []
    law.step, step = (lambda *given: (seen.append(bench.statuses()[-1].phase), step(*given))[1]), law.step
    controller = bench.controller(law)
    bench.run(controller, until=flying(controller))
    assert seen == [Phase.PLANNING]


def test_plans_are_in_each_agents_own_clock(mission, law):
    bench = Bench(mission)
    slow = VirtualClock(3.0)  # an agent that was started 97 s later, on another machine
    bench.agent("a1")
    other = bench.agent("a2", clock=slow)
    bench.agents.remove(other)
    controller = bench.controller(law)

    def follow(_):
        slow.wait_until(bench.clock.now() - 97.0, Event())
        while other.next_time <= slow.now() + 1e-9:
            other.tick()

    bench.run(controller, until=lambda: controller.done, after=follow)
    assert controller.exit_status == 0
    starts = zip(bench.plans("a1"), bench.plans("a2"), strict=True)
    shift = [first.start_s - second.start_s for first, second in starts]
    np.testing.assert_allclose(shift, shift[0], atol=1e-9)  # frozen: the grid never jitters
    assert shift[0] == pytest.approx(97.0, abs=0.1)
    assert not other.rejected


def test_ticks_lie_on_the_grid_and_missed_ones_are_skipped(bench, fleet, law):
    controller = bench.controller(law, budget_of=Budget.wall_clock)
    bench.run(controller, until=flying(controller))
    bench.run(controller, seconds=1.1)
    first = controller.next_time
    bench.wait_until(first + 1.3)  # the process was stopped for a while
    for agent in fleet:
        agent.tick()
    controller.tick()
    skipped = controller.step_log.skipped
    assert skipped >= 1
    assert (controller.next_time - first) / 0.5 == pytest.approx(round((controller.next_time - first) / 0.5), abs=1e-6)
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0
    assert all(not agent.rejected for agent in fleet)


@pytest.mark.parametrize("seed", range(3))
def test_under_loss_and_repeats_nobody_is_in_two_minds(mission, seed):
    random = np.random.default_rng(seed)

    def channel(key, payload):
        return (
            [payload] * random.choice([0, 1, 2], p=[0.3, 0.5, 0.2]) if "/plan" in key or "/state" in key else [payload]
        )

    bench, law = Bench(mission, channel), StraightSweepLaw(mission)
    fleet = [bench.agent("a1"), bench.agent("a2")]
    controller = bench.controller(law)
    bench.run(controller, until=lambda: controller.done, seconds=120.0)
    assert controller.exit_status == 0
    assert all(agent.at_rest for agent in fleet)
    assert set().union(*(agent.rejected for agent in fleet)) <= {Reason.OLD, Reason.START, Reason.EXPIRED}
    assert set(controller.fleet_monitor.rejected) <= {Reason.OLD}


def test_an_agent_that_starts_anew_makes_the_fleet_regroup(bench, fleet, law):
    controller = bench.controller(law)
    bench.run(controller, until=lambda: len(law.states) > 3)
    bench.agents.remove(fleet[0])
    fleet[0].shutdown()
    bench.agent("a1", instance="another-life")
    bench.run(controller, until=lambda: controller.phase is Phase.WAITING, seconds=5.0)
    assert "a1 started anew" in controller.heartbeat.text or "a1 started anew" in " ".join(bench.said)
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0


def test_an_agent_that_falls_silent_makes_the_fleet_regroup(bench, fleet, law):
    controller = bench.controller(law)
    bench.run(controller, until=lambda: len(law.states) > 3)
    bench.agents.remove(fleet[0])
    bench.run(controller, until=lambda: controller.phase is Phase.WAITING, seconds=5.0)
    assert "a1 not heard for 2 s" in " ".join(bench.said)
    bench.run(controller, seconds=10.0)
    assert controller.phase is Phase.WAITING
    assert fleet[1].at_rest
    bench.agents.append(fleet[0])  # it was only out of reach
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0


def test_a_law_that_raises_leaves_the_agents_on_their_plans(bench, fleet, law):
    controller = bench.controller(law)
    bench.run(controller, until=lambda: len(law.states) > 3)
    law.raises = ZeroDivisionError("a bug")
    bench.run(controller, until=lambda: controller.phase is Phase.WAITING, seconds=5.0)
    assert "3 steps failed" in " ".join(bench.said)
    law.raises = None
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0


def test_a_law_that_raises_once_while_everyone_is_at_rest_plans_again(bench, fleet, law):
    step, calls = law.step, []

    def raises_once(*given):
        calls.append(given)
        if len(calls) == 1:
            raise ZeroDivisionError("a bug")
        return step(*given)

    law.step = raises_once
    controller = bench.controller(law)
    bench.run(controller, until=flying(controller))
    assert controller.phase is Phase.FLYING
    assert any("it is tried again" in event.text for event in bench.events())


def test_a_law_that_cannot_plan_at_all_is_a_failure(bench, fleet, law):
    law.raises = ValueError("no")
    controller = bench.controller(law)
    bench.run(controller, until=lambda: controller.done)
    assert controller.phase is Phase.FAILED
    assert controller.exit_status == 1
    assert "planning failed" in controller.heartbeat.text


def tall_bench():
    """A mission that takes more than one horizon."""
    bench = Bench(small_mission(height=9.0))
    return bench, [bench.agent("a1"), bench.agent("a2")]


@pytest.mark.parametrize("first", [0, 3], ids=["at rest", "in flight"])
@pytest.mark.parametrize("fault", FAULTS)
def test_a_faulty_plan_never_gets_to_the_agents(fault, first):
    bench, fleet = tall_bench()
    law = FaultyLaw(bench.mission, fault, first, goal_y=8.5)
    controller = bench.controller(law)
    bench.run(controller, until=lambda: controller.done)
    assert controller.phase is Phase.FAILED
    assert controller.heartbeat.text == "the safety filter refused 3 plans in a row"
    assert controller.exit_status == 1
    assert len(law.at_rest) == (3 if first == 0 else 1 + 3)
    assert len(law.in_flight) == (0 if first == 0 else 2 + 3)
    assert all(agent.at_rest for agent in fleet)
    assert not any(agent.rejected for agent in fleet)
    for index, name in enumerate(bench.mission.fleet.ids):
        sent = bench.plans(name)
        assert [plan.seq for plan in sent] == list(range(first))
        for plan, good in zip(sent, law.good, strict=True):
            np.testing.assert_array_equal(plan.position, good.position[:, index])
            np.testing.assert_array_equal(plan.velocity, good.velocity[:, index])
            np.testing.assert_array_equal(plan.input, good.input[:, index])
    refused = [event.text for event in bench.events() if event.kind == "refused"]
    assert refused
    assert all(text.startswith("the safety filter refuses a plan: ") for text in refused)
    assert all(FAULTS[fault][1] in text for text in refused)


def test_what_was_refused_in_flight_is_planned_anew_at_rest():
    """The plan in force goes on, to its end at rest; a law that has come to its senses then flies the rest."""
    bench, fleet = tall_bench()
    law = FaultyLaw(bench.mission, "a collision", 3, goal_y=8.5)
    controller = bench.controller(law)
    bench.run(controller, until=lambda: controller.phase is Phase.WAITING and law.in_flight, seconds=20.0)
    assert "3 steps failed" in " ".join(bench.said)
    bench.run(controller, until=lambda: all(agent.at_rest for agent in fleet))
    np.testing.assert_allclose([a.plant.position for a in fleet], law.sent[-1].position[-1], atol=1e-9)
    law.recovers()
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0


def test_out_of_time_is_a_failure_and_everyone_comes_to_rest(law):
    bench = Bench(small_mission(time_limit_s=1.0))
    fleet = [bench.agent("a1"), bench.agent("a2")]
    controller = bench.controller(law)
    bench.run(controller, until=lambda: controller.done)
    assert controller.phase is Phase.FAILED
    assert "48 of 48" not in controller.heartbeat.text
    assert "cells are not reported as covered after control.time_limit_s 1 s" in controller.heartbeat.text
    assert all(agent.at_rest for agent in fleet)


def test_a_journal_that_fails_is_told_and_control_goes_on(bench, fleet, law):
    controller = bench.controller(law, checkpoints=CheckpointsInMemory("the disk is full"))
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0
    assert "controller: the disk is full" in bench.said


def test_two_controllers_of_different_epochs(bench, fleet):
    """The older one comes back from a long stop: nobody listens to it."""
    old = bench.controller(StraightSweepLaw(bench.mission, goal_y=2.0), epoch=1, identity="old")
    bench.run(old, until=flying(old))
    new = bench.controller(StraightSweepLaw(bench.mission), epoch=2, identity="new")
    bench.run(new, until=lambda: new.phase is Phase.FLYING)
    bench.run(new, seconds=0.6)
    bench.run(old, new, until=lambda: old.done and new.done)
    assert new.exit_status == 0
    assert old.exit_status == 1
    assert "a controller of epoch 2 has taken over from this one, of epoch 1" in " ".join(bench.said)
    assert all(agent.schedule.flown.ref.epoch == 2 for agent in fleet)


def test_a_law_may_stop_everyone_to_think():
    bench = Bench(small_mission(height=9.0, horizon_steps=5))
    bench.agent("a1"), bench.agent("a2")
    law = ThoughtfulLaw(bench.mission, goal_y=8.5)
    controller = bench.controller(law)
    bench.run(controller, until=lambda: controller.phase is Phase.WAITING and len(law.in_flight) == 3)
    assert "a step is too short to plan anew" in " ".join(bench.said)
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0
    assert len(law.at_rest) == 2
    assert "flies an unknown plan" not in " ".join(bench.said)
    numbers = [plan.seq for plan in bench.plans()]
    assert numbers == sorted(set(numbers))


def test_a_pause_ends_without_the_lost(bench, fleet):
    law = SharingLaw(bench.mission)
    controller = bench.controller(law)
    bench.run(controller, until=lambda: len(law.in_flight) >= 3)
    bench.kill(fleet[1])
    bench.run(controller, until=lambda: law.lost)
    asker = bench.bus.join()
    for number, command in enumerate(("pause", "resume")):
        asker.post(bench.keys.command(command), encode(CommandRequest(request=f"r{number}")))
        bench.run(controller, seconds=0.6)
    bench.run(controller, until=flying(controller), seconds=10.0)
    assert len(law.at_rest) == 2
    assert controller.supervisor.lost == ["a2"]


def test_the_mission_is_complete_without_the_lost(bench, fleet):
    law = SharingLaw(bench.mission)
    controller = bench.controller(law)
    bench.run(controller, until=lambda: len(law.in_flight) >= 3)
    bench.kill(fleet[1])
    bench.run(controller, until=lambda: law.lost)
    for cell in bench.mission.field.cell:  # someone saw the rest
        controller.coverage.observe(controller.mission_time_s, np.array([cell, [np.nan, np.nan]]))
    bench.run(controller, until=lambda: controller.done, seconds=20.0)
    assert controller.exit_status == 0
    assert controller.heartbeat.text == "everything is covered, and everyone but a2 is at rest"
    assert fleet[0].at_rest


def test_a_controller_that_was_asleep_does_not_think_that_others_were(bench, fleet):
    law = SharingLaw(bench.mission)
    controller = bench.controller(law)
    bench.run(controller, until=lambda: len(law.in_flight) >= 3)
    bench.bus.channel = lambda key, payload: [] if key.endswith("/state") else [payload]
    bench.run(seconds=3.5)  # stopped: nothing reached it
    bench.bus.channel = None
    controller.tick()
    assert controller.phase is Phase.FLYING
    bench.run(controller, seconds=1.0)
    assert not law.lost


def test_stay_answers_after_the_mission(bench, fleet, law):
    controller = bench.controller(law, stay=True)
    bench.run(controller, seconds=60.0)
    assert controller.phase is Phase.COMPLETE
    assert not controller.done
    assert controller.exit_status == 0
    controller.shutdown()
    assert bench.statuses()[-1].phase is Phase.COMPLETE


def test_shutdown_in_flight_says_stopped(bench, fleet, law):
    controller = bench.controller(law, checkpoints=(checkpoints := CheckpointsInMemory()))
    bench.run(controller, until=lambda: len(law.states) > 3)
    controller.shutdown()
    assert controller.phase is Phase.STOPPED
    assert checkpoints.kept.mission_time_s > 0.5
    bench.run(seconds=10.0)
    assert all(agent.at_rest for agent in fleet)
