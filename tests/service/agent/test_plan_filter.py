"""The agent's own filter: which plans it is willing to fly, whoever sent them."""

import json

import numpy as np
import pytest
from service_fakes import Bench, small_mission, straight_plan

from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.decoding import MAX_PAYLOAD, Reason
from mpc_cover.service.protocol.messages import PlanRef, encode


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


def test_a_plan_from_beyond_reach_is_ignored_by_a_disturbed_agent_too():
    bench = Bench(small_mission(disturbance={"position_noise_m": 0.02, "wind_m_per_s2": [0.0, 0.05]}))
    agent = bench.agent("a1")
    far = straight_plan(agent, 100.5)
    moved = [[x + 0.9, y] for x, y in far.position]
    publisher = bench.bus.join().publisher(bench.keys.plan("a1"), bus.PLAN)
    publisher.publish(encode(straight_plan(agent, 100.5, position=moved)))
    bench.run(seconds=0.3)
    assert agent.rejected == {Reason.START: 1}
