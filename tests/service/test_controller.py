"""The controller's tick: phases, prediction, the grid, and what it does when others fail."""

import json
from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from service_fakes import Bench, SweepLaw, small_mission

from mpc_cover.clock import VirtualClock
from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.decoding import Reason, decode_map, decode_plan, decode_reply, decode_status
from mpc_cover.service.protocol.messages import CommandRequest, Phase, encode


@pytest.fixture
def fleet(bench):
    return [bench.agent("a1"), bench.agent("a2")]


def flying(controller):
    return lambda: controller.phase is Phase.FLYING


def test_a_mission_from_waiting_to_everyone_at_rest(bench, fleet, law):
    controller = bench.controller(law)
    phases = []
    bench.run(controller, until=lambda: controller.done, after=lambda _: phases.append(controller.phase))
    assert list(dict.fromkeys(phases)) == [Phase.WAITING, Phase.PLANNING, Phase.FLYING, Phase.COMPLETE]
    assert controller.exit_status == 0
    assert law.coverage.complete
    assert all(agent.at_rest for agent in fleet)
    assert not Counter(agent.rejected for agent in fleet if agent.rejected)
    assert not controller.fleet_monitor.rejected


def test_it_waits_for_every_agent_and_says_for_whom(bench, law):
    bench.agent("a1")
    controller = bench.controller(law)
    bench.run(controller, seconds=3.0)
    assert controller.phase is Phase.WAITING
    assert controller.heartbeat.text == "a2 is not here"
    assert not law.calls
    bench.agent("a2")
    bench.run(controller, until=flying(controller))


def test_the_status_says_planning_before_the_planning(bench, fleet, law):
    seen = []
    inbox = bench.hear(bench.keys.status)
    law.prepare, prepare = (lambda *a, **k: (seen.extend(inbox.drain()), prepare(*a, **k))[1]), law.prepare
    controller = bench.controller(law)
    bench.run(controller, until=flying(controller))
    assert decode_status(seen[-1].payload).phase is Phase.PLANNING


def test_what_it_predicts_is_where_they_are(bench, fleet, law):
    controller = bench.controller(law)
    truth = {}

    def note(_):
        for index, agent in enumerate(fleet):
            truth.setdefault(round(agent.plant.time_s, 6), {})[index] = agent.plant.position.copy()

    bench.run(controller, until=lambda: controller.done, after=note)
    origin = 100.0 + 0.5  # first tick plans, take-off a period later
    steps = [call for call in law.calls if call[0] == "step"]
    assert len(steps) > 5
    for (_, start, _), (position, _) in zip(steps, law.predicted, strict=True):
        there = truth.get(round(origin + start, 6))
        if there:
            np.testing.assert_allclose(position, [there[0], there[1]], atol=1e-9)


def test_plans_are_in_each_agents_own_clock(mission, law):
    bench = Bench(mission)
    slow = VirtualClock(3.0)  # an agent that was started 97 s later, on another machine
    bench.agent("a1")
    other = bench.agent("a2", clock=slow)
    bench.agents.remove(other)
    controller = bench.controller(law)

    def follow(_):
        slow.wait_until(bench.clock.now() - 97.0, bench._never)
        while other.next_time <= slow.now() + 1e-9:
            other.tick()

    bench.run(controller, until=lambda: controller.done, after=follow)
    plans = {
        name: [decode_plan(item.payload, 2) for item in bench.hear(bench.keys.plan(name)).drain()]
        for name in ("a1", "a2")
    }
    assert controller.exit_status == 0
    shift = [first.start_s - second.start_s for first, second in zip(plans["a1"], plans["a2"], strict=True)]
    np.testing.assert_allclose(shift, shift[0], atol=1e-9)  # frozen: the grid never jitters
    assert shift[0] == pytest.approx(97.0, abs=0.1)
    assert not other.rejected


def test_ticks_lie_on_the_grid_and_missed_ones_are_skipped(bench, fleet, law):
    controller = bench.controller(law, deadlines=True)
    bench.run(controller, until=flying(controller))
    bench.run(controller, seconds=1.1)
    first = controller.next_time
    bench.clock.wait_until(first + 1.3, bench._never)  # the process was stopped for a while
    for agent in fleet:
        agent.tick()
    controller.tick()
    skipped = controller.step_log.skipped
    assert skipped >= 1
    assert (controller.next_time - first) / 0.5 == pytest.approx(round((controller.next_time - first) / 0.5), abs=1e-6)
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0
    assert all(not agent.rejected for agent in fleet)


def test_steps_have_a_deadline_by_the_grid(bench, fleet, law):
    controller = bench.controller(law, deadlines=True)
    bench.run(controller, until=lambda: len(law.calls) > 3)
    kind, _, deadline = law.calls[0]
    assert kind == "prepare"
    assert deadline is not None
    assert all(deadline is not None for _, _, deadline in law.calls)


@pytest.mark.parametrize("seed", range(3))
def test_under_loss_and_repeats_nobody_is_in_two_minds(mission, seed):
    random = np.random.default_rng(seed)

    def channel(key, payload):
        return (
            [payload] * random.choice([0, 1, 2], p=[0.3, 0.5, 0.2]) if "/plan" in key or "/state" in key else [payload]
        )

    bench, law = Bench(mission, channel), SweepLaw(mission)
    fleet = [bench.agent("a1"), bench.agent("a2")]
    controller = bench.controller(law)
    bench.run(controller, until=lambda: controller.done, seconds=120.0)
    assert controller.exit_status == 0
    assert all(agent.at_rest for agent in fleet)
    assert set().union(*(agent.rejected for agent in fleet)) <= {Reason.OLD, Reason.START, Reason.EXPIRED}
    assert set(controller.fleet_monitor.rejected) <= {Reason.OLD}


def test_repeated_and_reordered_states_are_rejected_and_the_map_is_the_same(mission):
    def fly(channel):
        bench, law = Bench(mission, channel), SweepLaw(mission)
        for name in ("a1", "a2"):
            bench.agent(name)
        controller = bench.controller(law)
        bench.run(controller, until=lambda: controller.done)
        return law.coverage.first, controller.fleet_monitor.rejected

    past = {}

    def echo(key, payload):
        former = past.get(key, payload)
        past[key] = payload
        return [payload, payload, former] if key.endswith("/state") else [payload]

    clean, none = fly(None)
    noisy, rejected = fly(echo)
    np.testing.assert_array_equal(clean, noisy)
    assert not none
    assert set(rejected) == {Reason.OLD}


def test_states_that_cannot_be_are_rejected(bench, fleet, law):
    controller = bench.controller(law)
    publisher = bench.bus.join().publisher(bench.keys.state("a1"), bus.STATE)
    bench.run(controller, until=flying(controller))
    newest = json.loads(encode(bench.states()[-1]))
    for fields in (
        {"position": [2.9, 3.9]},  # a teleport
        {"agent": "a2"},
        {"agent": "a9"},
        {"instance": "a1-life", "seq": 0},
    ):
        publisher.publish(json.dumps({**newest, "seq": 10**6, "time_s": newest["time_s"] + 0.01, **fields}).encode())
    publisher.publish(b"{")
    controller.tick()
    assert controller.fleet_monitor.rejected == {
        Reason.IMPLAUSIBLE: 1,
        Reason.WRONG_AGENT: 2,
        Reason.OLD: 1,
        Reason.MALFORMED: 1,
    }


def test_an_agent_that_starts_anew_makes_the_fleet_regroup(bench, fleet, law):
    controller = bench.controller(law)
    bench.run(controller, until=lambda: len(law.calls) > 3)
    bench.agents.remove(fleet[0])
    fleet[0].shutdown()
    bench.agent("a1", instance="another-life")
    bench.run(controller, until=lambda: controller.phase is Phase.WAITING, seconds=5.0)
    assert "a1 started anew" in controller.heartbeat.text or "a1 started anew" in " ".join(bench.said)
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0


def test_an_agent_that_falls_silent_makes_the_fleet_regroup(bench, fleet, law):
    controller = bench.controller(law)
    bench.run(controller, until=lambda: len(law.calls) > 3)
    bench.agents.remove(fleet[0])
    bench.run(controller, until=lambda: controller.phase is Phase.WAITING, seconds=5.0)
    assert "a1 not heard for 2 s" in " ".join(bench.said)
    bench.run(controller, seconds=10.0)
    assert controller.phase is Phase.WAITING
    assert fleet[1].at_rest
    bench.agents.append(fleet[0])  # it was only out of reach
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0


def test_a_brain_that_raises_leaves_the_agents_on_their_plans(bench, fleet, law):
    controller = bench.controller(law)
    bench.run(controller, until=lambda: len(law.calls) > 3)
    law.raises = ZeroDivisionError("a bug")
    bench.run(controller, until=lambda: controller.phase is Phase.WAITING, seconds=5.0)
    assert "3 steps failed" in " ".join(bench.said)
    law.raises = None
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0


def test_a_brain_that_cannot_plan_at_all_is_a_failure(bench, fleet, law):
    law.raises = ValueError("no")
    controller = bench.controller(law)
    bench.run(controller, until=lambda: controller.done)
    assert controller.phase is Phase.FAILED
    assert controller.exit_status == 1
    assert "planning failed" in controller.heartbeat.text


def test_out_of_time_is_a_failure_and_everyone_comes_to_rest(law):
    bench = Bench(small_mission(time_limit_s=1.0))
    fleet = [bench.agent("a1"), bench.agent("a2")]
    controller = bench.controller(law)
    bench.run(controller, until=lambda: controller.done)
    assert controller.phase is Phase.FAILED
    assert "48" not in controller.heartbeat.text
    assert "cells are not covered after control.time_limit_s 1 s" in controller.heartbeat.text
    assert all(agent.at_rest for agent in fleet)


def test_different_speeds_and_missions_are_told(bench, law):
    bench.agent("a1")
    bench.agent("a2")
    controller = bench.controller(law, speed=2.0)
    bench.run(controller, seconds=2.0)
    assert controller.heartbeat.text.startswith("a1 runs at --speed 1, this controller at 2")
    other = Bench(small_mission(time_limit_s=17.0))
    other.agent("a1")
    other.agent("a2")
    controller = other.controller(SweepLaw(bench.mission))
    assert other.mission.spec.name == bench.mission.spec.name
    controller.fleet_monitor._mission = "other"
    other.run(controller, seconds=2.0)
    assert "a1 has another version of this mission" in controller.heartbeat.text


def test_it_goes_on_from_a_snapshot_and_asks_what_was_measured_since(bench, fleet, law):
    first = bench.controller(law, checkpoints=(checkpoints := CheckpointStore()))
    bench.run(first, until=lambda: len(law.calls) > 4)
    bench.run(seconds=20.0)  # the first is dead: nobody ticks it
    truth = bench.clock.now() - 100.5
    successor = SweepLaw(bench.mission)
    second = bench.controller(successor, epoch=2, identity="second", resume=checkpoints.kept)
    bench.run(second, until=lambda: second.done)
    assert second.exit_status == 0
    assert successor.coverage.complete
    assert np.all(successor.coverage.first <= law.coverage.first)
    assert second.heartbeat.status.mission_time_s == pytest.approx(truth, abs=2.0)


class CheckpointStore:
    def __init__(self, problem=None):
        self.kept = None
        self.problem = problem

    def save(self, snapshot, *, now):
        self.kept = snapshot
        return self.problem

    def close(self):
        pass


def test_a_journal_that_fails_is_told_and_control_goes_on(bench, fleet, law):
    controller = bench.controller(law, checkpoints=CheckpointStore("the disk is full"))
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0
    assert "controller: the disk is full" in bench.said


def test_two_controllers_of_different_epochs(bench, fleet, law):
    """The older one comes back from a long stop: nobody listens to it."""
    old = bench.controller(SweepLaw(bench.mission, goal_y=2.0), epoch=1, identity="old")
    bench.run(old, until=flying(old))
    successor = SweepLaw(bench.mission)
    new = bench.controller(successor, epoch=2, identity="new")
    bench.run(new, until=lambda: new.phase is Phase.FLYING)
    bench.run(new, seconds=0.6)
    bench.run(old, new, until=lambda: old.done and new.done)
    assert new.exit_status == 0
    assert old.exit_status == 1
    assert "a controller of epoch 2 has taken over from this one, of epoch 1" in " ".join(bench.said)
    assert all(agent.schedule.flown.ref.epoch == 2 for agent in fleet)


def test_pause_resume_and_a_repeated_request(bench, fleet, law):
    controller = bench.controller(law)
    bench.run(controller, until=lambda: len(law.calls) > 2)
    asker = bench.bus.join()
    pause, again = (asker.post(bench.keys.command("pause"), encode(CommandRequest(request="r1"))) for _ in range(2))
    bench.run(controller, seconds=0.6)
    assert [decode_reply(answer[1]).accepted for answer in (*pause, *again)] == [True, True]
    bench.run(controller, seconds=10.0)
    assert controller.phase is Phase.WAITING
    assert controller.heartbeat.text == "paused"
    asker.post(bench.keys.command("resume"), encode(CommandRequest(request="r2")))
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0


def test_abort_and_what_is_no_command(bench, fleet, law):
    controller = bench.controller(law)
    bench.run(controller, until=flying(controller))
    asker = bench.bus.join()
    wrong = asker.post(bench.keys.command("explode"), encode(CommandRequest(request="r1")))
    junk = asker.post(bench.keys.command("abort"), b"junk")
    bench.run(controller, seconds=0.6)
    assert [answered for answered, _ in (*wrong, *junk)] == [False, False]
    assert b"must be one of pause, resume, abort" in wrong[0][1]
    asker.post(bench.keys.command("abort"), encode(CommandRequest(request="r2")))
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 1
    assert all(agent.at_rest for agent in fleet)


def test_the_map_is_published_and_can_be_asked_for(bench, fleet, law):
    controller = bench.controller(law)
    bench.run(controller, until=flying(controller))
    answer = bench.bus.join().post(bench.keys.map, b"")
    bench.run(controller, until=lambda: controller.done)
    asked = decode_map(answer[0][1])
    last = decode_map(bench.hear(bench.keys.map).drain()[-1].payload)
    assert asked.covered_count <= last.covered_count <= 48
    bits = np.unpackbits(np.frombuffer(bytes.fromhex(asked.bits), dtype=np.uint8))[: asked.cell_count]
    assert bits.sum() == asked.covered_count


def test_the_heartbeat_is_at_most_twice_a_second_and_only_out_of_ticks(bench, fleet, law):
    inbox = bench.hear(bench.keys.status)
    controller = bench.controller(law)
    bench.run(controller, until=lambda: controller.done)
    seen = inbox.drain()
    statuses = [decode_status(item.payload) for item in seen]
    assert [status.seq for status in statuses] == list(range(len(seen)))
    beats = [(item.received_s, status.phase) for item, status in zip(seen, statuses, strict=True)]
    for (before, former), (now, phase) in pairwise(beats):
        assert now - before > 0.5 - 1e-6 or former is not phase
    assert statuses[-1].phase is Phase.COMPLETE
    assert statuses[-1].covered_count == 48


def test_stay_answers_after_the_mission(bench, fleet, law):
    controller = bench.controller(law, stay=True)
    bench.run(controller, seconds=60.0)
    assert controller.phase is Phase.COMPLETE
    assert not controller.done
    assert controller.exit_status == 0
    controller.shutdown()
    assert decode_status(bench.hear(bench.keys.status).drain()[-1].payload).phase is Phase.COMPLETE


def test_shutdown_in_flight_says_stopped(bench, fleet, law):
    controller = bench.controller(law, checkpoints=(checkpoints := CheckpointStore()))
    bench.run(controller, until=lambda: len(law.calls) > 3)
    controller.shutdown()
    assert controller.phase is Phase.STOPPED
    assert checkpoints.kept.mission_time_s > 0.5
    bench.run(seconds=10.0)
    assert all(agent.at_rest for agent in fleet)
