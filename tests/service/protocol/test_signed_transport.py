"""Signed end to end: an agent flies and a controller obeys only what is genuine, whoever brings it.

The bus in memory has no access control: it is as a router that has been taken over, which passes on whatever it likes.
"""

import time

import msgspec
import pytest
from fleet_keys import load, make_fleet
from service_fakes import Bench, CheckpointsInMemory, straight_plan
from sweep_laws import StraightSweepLaw

from mpc_cover.service.controller.commands import CommandServer
from mpc_cover.service.controller.fleet_monitor import FleetMonitor
from mpc_cover.service.credentials.signature import sign
from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.decoding import Reason, decode_plan
from mpc_cover.service.protocol.messages import CommandRequest, Phase, encode
from mpc_cover.service.protocol.signed_transport import REPLY, SignedTransport, verified


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    return make_fleet(tmp_path_factory.mktemp("keys"))


@pytest.fixture(scope="module")
def who(fleet):
    return {role: load(fleet, role) for role in ("controller", "operator", "viewer", "a1", "a2")}


@pytest.fixture
def bench(mission, who):
    return Bench(mission, sign=lambda role, transport: SignedTransport(transport, who[role]))


@pytest.fixture
def fleet_of_two(bench):
    return [bench.agent("a1"), bench.agent("a2")]


def signed(who, role, topic, message):
    return sign(who[role].signing_key, topic, encode(message))


@pytest.fixture
def agent(bench):
    return bench.agent("a1")


@pytest.fixture
def send(bench):
    """Return a function that publishes bytes on a key, as nobody in particular."""
    stranger = bench.bus.join()

    def send(key, payload, quality=bus.PLAN):
        stranger.publisher(key, quality).publish(payload)
        bench.run(seconds=0.1)

    return send


def events(bench, kind):
    return [event.text for event in bench.events() if event.kind == kind]


def test_a_fleet_with_keys_covers_its_mission_and_nothing_is_turned_away(bench, fleet_of_two, mission):
    controller = bench.controller(StraightSweepLaw(mission))
    bench.run(controller, until=lambda: controller.done)
    assert controller.phase is Phase.COMPLETE
    assert not controller.fleet_monitor.rejected
    assert not any(agent.rejected for agent in fleet_of_two)


def test_a_plan_of_the_controller_is_flown(bench, agent, send, who):
    plan = straight_plan(agent, 100.5)
    send(bench.keys.plan("a1"), signed(who, "controller", bench.keys.plan("a1"), plan))
    bench.run(seconds=10.0)
    assert not agent.rejected
    assert bench.states()[-1].position == pytest.approx(plan.position[-1])


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        pytest.param(lambda who, key, plan: encode(plan), Reason.UNSIGNED, id="unsigned"),
        pytest.param(lambda who, key, plan: signed(who, "a2", key, plan), Reason.FORGED, id="by an agent"),
        pytest.param(lambda who, key, plan: signed(who, "operator", key, plan), Reason.FORGED, id="by the operator"),
        pytest.param(
            lambda who, key, plan: signed(who, "controller", key.replace("a1", "a2"), plan),
            Reason.FORGED,
            id="for another agent's key",
        ),
        pytest.param(
            lambda who, key, plan: signed(who, "controller", key, plan).replace(b'"seq":0', b'"seq":9'),
            Reason.FORGED,
            id="changed on the way",
        ),
        pytest.param(lambda who, key, plan: b"x" * (2 << 20), Reason.OVERSIZE, id="large"),
        pytest.param(lambda who, key, plan: b"", Reason.UNSIGNED, id="empty"),
    ],
)
def test_a_plan_of_anybody_else_is_not_flown_whatever_its_epoch_and_the_reason_is_said(
    bench, agent, send, who, make, reason
):
    key = bench.keys.plan("a1")
    send(key, make(who, key, straight_plan(agent, 100.5, epoch=2**40)))
    bench.run(seconds=2.0)
    assert agent.rejected == {reason: 1}
    assert agent.at_rest
    assert events(bench, reason.name.lower())[0].startswith(f"ignores a plan: {reason}")
    genuine = straight_plan(agent, bench.clock.now() + 0.5)
    send(key, signed(who, "controller", key, genuine))
    bench.run(seconds=1.0)
    assert bench.states()[-1].plan == genuine.ref, "the epoch that was claimed has changed nothing"


def test_a_genuine_plan_that_is_sent_again_is_not_flown_again_nor_by_the_agent_that_is_started_anew(
    bench, agent, send, who
):
    key = bench.keys.plan("a1")
    replayed = signed(who, "controller", key, straight_plan(agent, 100.5))
    send(key, replayed)
    bench.run(seconds=0.5)
    send(key, replayed)
    assert agent.rejected == {Reason.OLD: 1}
    bench.kill(agent)
    again = bench.agent("a1", instance="second-life")
    send(key, replayed)
    assert again.rejected[Reason.WRONG_INSTANCE] >= 1
    assert again.at_rest


def test_a_flood_of_forged_plans_costs_no_more_than_the_depth_of_the_queue(bench, agent, who):
    """2000 between two ticks: 8 are looked at; the plan that comes after them is flown."""
    key, stranger = bench.keys.plan("a1"), bench.bus.join().publisher(bench.keys.plan("a1"), bus.PLAN)
    forged = signed(who, "a2", key, straight_plan(agent, 100.5, epoch=9))
    for _ in range(2000):
        stranger.publish(forged)
    plan = straight_plan(agent, 100.5)
    stranger.publish(signed(who, "controller", key, plan))
    begin = time.process_time()
    bench.run(seconds=0.1)
    assert time.process_time() - begin < 0.1
    assert agent.rejected == {Reason.FORGED: 7}
    bench.run(seconds=0.6)
    assert bench.states()[-1].plan == plan.ref


def test_a_state_that_another_agent_signed_is_counted_and_said_and_changes_nothing(bench, fleet_of_two, mission, who):
    controller = bench.controller(StraightSweepLaw(mission))
    bench.run(controller, until=lambda: controller.phase is Phase.FLYING)
    before, key = controller.fleet_monitor.links[0].state, bench.keys.state("a1")
    forged = msgspec.structs.replace(before, seq=2**40, position=[2.9, 3.9])
    stranger = bench.bus.join().publisher(key, bus.STATE)
    for payload in (signed(who, "a2", key, forged), encode(forged)):
        stranger.publish(payload)
    bench.run(controller, seconds=0.6)
    after = controller.fleet_monitor
    assert after.rejected == {Reason.FORGED: 1, Reason.UNSIGNED: 1}
    assert before.seq < after.links[0].state.seq < 2**30
    assert events(bench, "state-refused") == ["ignores a state: wrongly signed: must be signed by a1"]


def test_states_of_before_are_no_agent_that_is_ready(mission, who):
    """Everything that an agent said in an earlier flight is sent again, its presence, too, and the agent is cut off."""
    sign_as = {"sign": lambda role, transport: SignedTransport(transport, who[role])}
    earlier = Bench(mission, **sign_as)
    for name in ("a1", "a2"):
        earlier.agent(name)
    former = earlier.controller(StraightSweepLaw(mission), identity="former")
    earlier.run(former, until=lambda: former.done)
    recorded = [item.payload for item in earlier.hear(earlier.keys.state("a1")).drain()]
    assert len(recorded) > 20
    bench = Bench(mission, **sign_as)
    bench.agent("a2")
    controller = bench.controller(StraightSweepLaw(mission), identity="present")
    bench.run(controller, seconds=1.0)
    seen = controller.coverage.covered_count
    router = bench.bus.join()
    router.announce(bench.keys.agent_alive("a1", "a1-life"))
    publisher, left, texts = router.publisher(bench.keys.state("a1"), bus.Quality("DATA")), iter(recorded), set()

    def replay(_):
        publisher.publish(next(left, recorded[-1]))
        texts.add(controller.heartbeat.text)

    bench.run(controller, seconds=8.0, after=replay)
    assert controller.phase is Phase.WAITING
    assert "a1 has not heard this controller yet" in texts
    assert controller.coverage.covered_count == seen, "what was measured in another flight is not measured in this one"


@pytest.mark.parametrize("keys", [False, True], ids=["without keys", "with keys"])
def test_what_was_measured_while_the_controller_was_down_counts_all_the_same(mission, who, keys):
    bench = Bench(mission, sign=(lambda role, transport: SignedTransport(transport, who[role])) if keys else None)
    agents, checkpoints = [bench.agent("a1"), bench.agent("a2")], CheckpointsInMemory()
    former = bench.controller(StraightSweepLaw(mission), identity="former", checkpoints=checkpoints)
    bench.run(former, until=lambda: former.phase is Phase.FLYING)
    bench.run(former, seconds=1.2)
    before = former.coverage.covered_count
    bench.run(seconds=8.0)
    assert all(agent.at_rest for agent in agents)
    law, resume = StraightSweepLaw(mission), checkpoints.kept
    present = bench.controller(law, identity="present", epoch=2, resume=resume)
    bench.run(present, seconds=0.6)
    assert present.coverage.covered_count > before + 5
    bench.run(present, until=lambda: present.done)
    assert present.phase is Phase.COMPLETE


def test_a_flood_of_one_agent_takes_no_room_of_another_and_bounded_time(bench, mission, who):
    """20,000 messages that an agent with its own certificate sends on its own key, between two ticks."""
    monitor = FleetMonitor(mission, SignedTransport(bench.bus.join(), who["controller"]))
    agents = [bench.agent("a1"), bench.agent("a2")]
    bench.run(seconds=0.35)
    flood = bench.bus.join().publisher(bench.keys.state("a1"), bus.STATE)
    forged = signed(who, "a2", bench.keys.state("a1"), bench.states("a1")[-1])
    for _ in range(20_000):
        flood.publish(forged)
    bench.run(seconds=0.1)
    begin = time.process_time()
    monitor.receive()
    assert time.process_time() - begin < 1.0, "a tenth, on a machine with nothing else to do"
    assert monitor.links[1].state.seq == agents[1]._seq - 1
    assert monitor.rejected[Reason.FORGED] <= 1024
    assert monitor.rejected[Reason.FLOOD] >= 1024
    bench.run(seconds=1.0)
    monitor.receive()
    assert monitor.links[0].state.seq == agents[0]._seq - 1, "and it is heard again, once it is over"


def test_nobody_outside_the_fleet_is_an_agent_of_it(bench, who):
    inbox = SignedTransport(bench.bus.join(), who["controller"]).inbox(bench.keys.state(), 8)
    stranger = bench.bus.join().publisher(bench.keys.state("a9"), bus.STATE)
    stranger.publish(sign(who["a1"].signing_key, bench.keys.state("a9"), b'{"schema":1}'))
    assert not inbox.drain()
    assert [str(error) for error in inbox.take_refused()] == ["wrongly signed: a9 is not of fleet fleet"]


def command(who, role, key, *, to, request="r1"):
    return signed(who, role, key, CommandRequest(request=request, controller=to))


def test_only_the_operator_aborts_and_only_this_controller(bench, fleet_of_two, mission, who):
    controller = bench.controller(StraightSweepLaw(mission), identity="me")
    bench.run(controller, until=lambda: controller.phase is Phase.FLYING)
    key, asker = bench.keys.command("abort"), bench.bus.join()
    refused = [
        asker.post(key, payload)
        for payload in (
            encode(CommandRequest(request="r0", controller="me")),
            command(who, "a1", key, to="me"),
            command(who, "controller", key, to="me"),
            command(who, "operator", bench.keys.command("pause"), to="me"),
            command(who, "operator", key, to="another"),
            command(who, "operator", key, to=""),
        )
    ]
    bench.run(controller, seconds=1.0)
    assert controller.phase is Phase.FLYING
    assert [answered for answers in refused for answered, _ in answers] == [False] * 6
    assert b"not signed" in refused[0][0][1]
    assert events(bench, "command-refused")[0].startswith("ignores a command: not signed")
    accepted = asker.post(key, command(who, "operator", key, to="me"))
    bench.run(controller, until=lambda: controller.done)
    assert controller.phase is Phase.FAILED
    answered, reply = accepted[0]
    assert answered
    assert b'"accepted":true' in verified(who["operator"], "controller", key + REPLY, reply)


def test_a_command_that_is_sent_again_is_not_obeyed_again_however_many_came_since(bench, mission, who):
    transport, asker = SignedTransport(bench.bus.join(), who["controller"]), bench.bus.join()
    server, pause, resume = (
        CommandServer(mission, transport, "me"),
        bench.keys.command("pause"),
        bench.keys.command("resume"),
    )
    first = command(who, "operator", pause, to="me", request="first")
    asker.post(pause, first)
    assert [each.name for each in server.receive()] == ["pause"]
    for number in range(100):
        asker.post(resume, command(who, "operator", resume, to="me", request=f"r{number}"))
        assert len(server.receive()) == 1
    replayed = asker.post(pause, first)
    assert server.receive() == []
    assert not server.paused
    assert replayed == [(False, b"old or repeated: request first")]
    assert [error.reason for error in server.take_refused()] == [Reason.OLD]


def test_a_status_of_before_that_is_sent_again_does_not_make_an_agent_leave(bench, fleet_of_two, mission, who):
    """One that says that the id is another process's, as was so when another process was there."""
    agent = fleet_of_two[0]
    controller = bench.controller(StraightSweepLaw(mission))
    bench.run(controller, seconds=2.0)
    status = msgspec.structs.replace(controller.heartbeat.status, seq=0, instances={"a1": "former-life"})
    replayed = signed(who, "controller", bench.keys.status, status)
    publisher = bench.bus.join().publisher(bench.keys.status, bus.STATUS)
    bench.run(seconds=6.0, after=lambda _: publisher.publish(replayed))  # and nothing of the controller gets through
    assert not agent.taken_by


def test_what_is_sent_can_be_read_by_who_has_no_keys(bench, agent, who):
    plan = straight_plan(agent, 100.5)
    payload = signed(who, "controller", bench.keys.plan("a1"), plan)
    assert decode_plan(payload, 2) == plan
