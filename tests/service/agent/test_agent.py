"""The agent's own filter and deadman: it flies what is safe for it, and always ends at rest."""

import json

import numpy as np
import pytest
from service_fakes import straight_plan

from mpc_cover.clock import VirtualClock
from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.decoding import MAX_PAYLOAD, Reason
from mpc_cover.service.protocol.messages import PlanMessage, PlanRef, encode


@pytest.fixture
def agent(bench):
    return bench.agent("a1")


@pytest.fixture
def send(bench, agent):
    publisher = bench.bus.join().publisher(bench.keys.plan(agent.id), bus.PLAN)

    def send(message):
        publisher.publish(encode(message) if isinstance(message, PlanMessage) else message)
        bench.run(seconds=0.1)

    return send


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


def off(plan, field, index, by):
    rows = [list(row) for row in getattr(plan, field)]
    rows[index][0] += by
    return {field: rows}


def cut(plan, steps):
    return {
        "position": plan.position[: steps + 1],
        "velocity": plan.velocity[: steps + 1],
        "input": plan.input[:steps],
    }


def moving_start(plan):
    later = {"position": plan.position[1:], "velocity": plan.velocity[1:], "input": plan.input[1:]}
    shift = np.array(later["position"]) - np.array(later["position"][0]) + np.array(plan.position[0])
    return {**later, "position": shift.tolist()}


BAD = {
    "wrong agent": (Reason.WRONG_AGENT, lambda plan: {"agent": "a2"}),
    "another life": (Reason.WRONG_INSTANCE, lambda plan: {"instance": "former"}),
    "expired": (Reason.EXPIRED, lambda plan: {"start_s": 99.0, "valid_until_s": 99.5}),
    "no dynamics": (Reason.DYNAMICS, lambda plan: off(plan, "position", 3, 1e-3)),
    "velocity from nowhere": (Reason.DYNAMICS, lambda plan: off(plan, "velocity", 3, 1e-3)),
    "input too large": (Reason.LIMITS, lambda plan: off(plan, "input", 0, 5.0)),
    "speed too large": (Reason.LIMITS, lambda plan: off(plan, "velocity", 2, 5.0)),
    "outside the fence": (Reason.FENCE, lambda plan: off(plan, "position", -1, -5.0)),
    "moves at its end": (Reason.NOT_AT_REST, lambda plan: cut(plan, 2)),
    "starts elsewhere": (Reason.START, lambda plan: {"position": (np.array(plan.position) + 0.01).tolist()}),
    "starts at another speed": (Reason.START, moving_start),
}


@pytest.mark.parametrize(("reason", "change"), BAD.values(), ids=BAD)
def test_a_bad_plan_is_ignored_counted_and_told(bench, agent, send, reason, change):
    good = straight_plan(agent, 100.5)
    send(straight_plan(agent, 100.5, **change(good)))
    assert agent.rejected == {reason: 1}
    assert agent.at_rest
    assert [event.kind for event in bench.events()] == [reason.name.lower()]
    send(good)  # and it does no harm to what comes after
    assert agent.rejected == {reason: 1}
    assert not agent.at_rest


@pytest.mark.parametrize("change", [change for _, change in BAD.values()], ids=BAD)
def test_a_bad_plan_in_flight_leaves_the_flight_as_it_is(bench, agent, send, change):
    plan = straight_plan(agent, 100.5)
    send(plan)
    bench.run(seconds=0.6)
    send(straight_plan(agent, 101.0, seq=1, **change(straight_plan(agent, 101.0, seq=1))))
    bench.run(seconds=10.0)
    assert agent.rejected.total() == 1
    np.testing.assert_allclose(agent.plant.position, plan.position[-1], atol=1e-12)


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"not json", Reason.MALFORMED),
        (b"x" * (MAX_PAYLOAD + 1), Reason.OVERSIZE),
        (b'{"schema": 7}', Reason.SCHEMA),
    ],
)
def test_a_bad_payload_is_ignored(agent, send, payload, reason):
    send(payload)
    assert agent.rejected == {reason: 1}


def test_numbers_that_are_not_finite_are_ignored(agent, send):
    raw = json.loads(encode(straight_plan(agent, 100.5)))
    raw["position"][2][1] = "@"
    send(json.dumps(raw).replace('"@"', "1e999").encode())
    assert agent.rejected.total() == 1
    assert agent.at_rest


def test_old_epochs_and_twins_are_turned_away(bench, agent, send):
    send(straight_plan(agent, 100.5, epoch=5, controller="c5"))
    flown = agent.schedule.queue[0].ref
    send(straight_plan(agent, 100.7, epoch=4, controller="c4", seq=9))
    send(straight_plan(agent, 100.7, epoch=5, controller="twin", seq=9))
    assert agent.rejected == {Reason.OLD_EPOCH: 1, Reason.OTHER_CONTROLLER: 1}
    assert agent.schedule.queue[0].ref == flown
    send(straight_plan(agent, 100.9, epoch=6, controller="c6", seq=0))
    assert agent.schedule.queue[-1].ref == PlanRef(6, 0)
    assert {event.kind for event in bench.events()} == {"controller", "old_epoch", "other_controller"}


def test_repeats_and_reordered_plans_are_counted_but_not_told(bench, agent, send):
    first, second = straight_plan(agent, 100.5), straight_plan(agent, 100.6, seq=1)
    send(second)
    send(second)
    send(first)
    assert agent.rejected == {Reason.OLD: 2}
    assert [event.kind for event in bench.events()] == ["controller"]


def test_a_rejected_plan_does_not_raise_the_epoch(agent, send):
    send(straight_plan(agent, 100.5, epoch=99, period=0.5, agent="a2"))
    send(straight_plan(agent, 100.5, epoch=98, **off(straight_plan(agent, 100.5), "input", 0, 9.0)))
    send(straight_plan(agent, 100.5, epoch=1))
    assert agent.schedule.queue[0].ref == PlanRef(1, 0)


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
