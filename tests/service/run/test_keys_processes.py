"""Real processes with keys over TLS on loopback: a fleet flies; whoever has no right to steer it does not."""

import json
import re
import subprocess
import sys
import time
from threading import Event

import msgspec
import pytest
from fleet_keys import join as join_fleet
from fleet_keys import load, make_fleet
from service_fakes import small_mission, until
from swarm_missions import swarm_mission

from mpc_cover.service.credentials.signature import sign
from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.bus import NoAnswerError
from mpc_cover.service.protocol.decoding import decode_event, decode_plan, decode_state, decode_status
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.protocol.messages import CommandRequest, PlanMessage, encode
from mpc_cover.service.run.processes import free_port

KEYS = Keys("small")
SPEED = "3"
FLOOD = 2000
"""Forged messages that are sent at once."""


class Processes:
    """`mpc-cover` commands in a folder, each with its own log."""

    def __init__(self, folder, fleet, endpoint):
        self.folder, self.fleet, self.endpoint = folder, fleet, endpoint
        self.running = {}

    def start(self, name, *command):
        with (self.folder / f"{name}.log").open("ab") as log:
            line = [sys.executable, "-m", "mpc_cover", *command]
            self.running[name] = subprocess.Popen(line, stdout=log, stderr=log, cwd=self.folder)
        return self.running[name]

    def agent(self, name, *options, keys=None):
        credentials = ("--credentials", str((keys or self.fleet) / name))
        where = ("-e", self.endpoint, "--speed", SPEED)
        return self.start(name, "agent", "m.json", "--id", name, *credentials, *where, *options)

    def serve(self, *options, where="-l"):
        credentials = ("--credentials", str(self.fleet / "controller"))
        return self.start("serve", "serve", "m.json", *credentials, where, self.endpoint, "--speed", SPEED, *options)

    def said(self, name):
        return (self.folder / f"{name}.log").read_text()

    def wait_for(self, name, text, seconds=30.0):
        until(lambda: text in self.said(name) or self.running[name].poll() is not None, seconds)
        assert text in self.said(name), self.said(name)

    def stop(self):
        for process in self.running.values():
            process.kill()
            process.wait()


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    return make_fleet(tmp_path_factory.mktemp("keys"))


@pytest.fixture
def processes(tmp_path, fleet):
    raw = json.loads(small_mission().to_json())
    (tmp_path / "m.json").write_text(json.dumps(raw))
    processes = Processes(tmp_path, fleet, f"tls/127.0.0.1:{free_port()}")
    yield processes
    processes.stop()


@pytest.fixture
def join(fleet, processes):
    """Return a function that joins in a role, from this process."""
    joined = []

    def join(role, **options):
        joined.append(join_fleet(fleet, role, connect=[processes.endpoint], timeout_s=20.0, **options))
        return joined[-1]

    yield join
    for transport in joined:
        transport.close()


def test_a_fleet_flies_while_forgers_with_and_without_rights_try_everything(processes, join, fleet):
    """Through a router. Every message here is one of those that made a fleet collide before there were keys."""
    router = ("router", "--credentials", str(fleet / "router"), "-l", processes.endpoint)
    processes.start("router", *router)
    processes.serve(where="-e")
    first = processes.agent("a1")
    processes.agent("a2")
    viewer, forger, former = join("viewer"), join("a2"), join("controller")
    plans, states = viewer.inbox(KEYS.plan("a1"), 64, history=1), viewer.inbox(KEYS.state("a1"), 4096, history=8)
    statuses = viewer.inbox(KEYS.status, 64, history=1)
    plan = decode_plan(until(plans.drain, 30.0)[0].payload, 2)
    high = msgspec.structs.replace(plan, epoch=plan.epoch + 1000, controller="forger")
    signed_by_agent = sign(load(fleet, "a2").signing_key, KEYS.plan("a1"), encode(high))
    state = decode_state(until(states.drain)[-1].payload, 2)
    wrong = msgspec.structs.replace(state, seq=2**40, position=[2.9, 3.9])
    forged = [
        (KEYS.plan("a1"), signed_by_agent),
        (KEYS.plan("a1"), encode(high)),
        (KEYS.state("a1"), sign(load(fleet, "a2").signing_key, KEYS.state("a1"), encode(wrong))),
        (KEYS.state("a1"), b"x" * (64 << 20)),
        (KEYS.status, encode(decode_status(until(statuses.drain)[-1].payload))),
    ]
    inner = forger._inner  # what is sent is signed already, or not at all
    for key, payload in forged:
        inner.publisher(key, bus.PLAN).publish(payload)
    flood = inner.publisher(KEYS.plan("a1"), bus.PLAN)
    for _ in range(FLOOD):
        flood.publish(signed_by_agent)
    with pytest.raises(NoAnswerError):
        viewer.ask(KEYS.command("abort"), encode(CommandRequest(request="r")), 0.3)
    # the controller's own certificate, in the hands of who has not its signing key: as a router that was taken over
    events = viewer.inbox(KEYS.agent_event("a1"), 64, history=64)
    taken = former._inner.publisher(KEYS.plan("a1"), bus.PLAN)

    def refused():
        taken.publish(signed_by_agent)
        return [text for item in events.drain() if "wrongly signed" in (text := decode_event(item.payload).text)]

    assert "must be signed by controller" in until(refused)[0]
    processes.wait_for("serve", "everything is covered and everyone is at rest")
    flown = [decode_state(item.payload, 2) for item in states.drain()]
    assert {each.plan.epoch for each in flown if each.plan} == {plan.epoch}
    assert flown[-1].seq < 2**30
    missed = re.findall(r"(\d+) deadlines missed", processes.said("serve"))
    assert int(missed[-1]) <= 1, "one, as the machine may be busy"
    first.kill()
    first.wait()
    processes.agent("a1")
    again = until(lambda: [s for i in states.drain() if (s := decode_state(i.payload, 2)).instance != state.instance])
    replayed = sign(load(fleet, "controller").signing_key, KEYS.plan("a1"), encode(plan))

    def turned_away():
        taken.publish(replayed)
        return [text for item in events.drain() if "wrong instance" in (text := decode_event(item.payload).text)]

    assert until(turned_away)
    assert again[-1].plan is None


def test_the_operator_pauses_and_retasks(processes, fleet):
    processes.serve("--stay")
    for name in ("a1", "a2"):
        processes.agent(name)
    processes.wait_for("serve", "flying")
    raw = json.loads((processes.folder / "m.json").read_text())
    (processes.folder / "new.json").write_text(json.dumps({**raw, "area": {**raw["area"], "cell_size_m": 0.25}}))
    by = ("-e", processes.endpoint, "--credentials", str(fleet / "operator"))
    pause = processes.start("pause", "command", "pause", "m.json", *by)
    assert pause.wait(30.0) == 0, processes.said("pause")
    assert processes.said("pause") == "pause: done\n"
    retask = processes.start("retask", "retask", "new.json", *by)
    assert retask.wait(30.0) == 0, processes.said("retask")
    assert "of 192 cells are covered already; everyone comes to rest" in processes.said("retask")


def test_a_stranger_stays_outside_and_it_is_said_why(processes, tmp_path):
    """Of a fleet of the same name, with the same agents."""
    strangers = make_fleet(tmp_path / "strangers")
    processes.serve()
    processes.wait_for("serve", "a1 is not here")
    outside = processes.agent("a1", "--connect-timeout", "0.5", keys=strangers)
    assert outside.wait(20.0) == 2
    assert "of the same fleet fleet, with a certificate that has not expired" in processes.said("a1")
    assert "Traceback" not in processes.said("a1")


def test_insecure_is_said_in_every_status_line(processes):
    endpoint = f"tcp/0.0.0.0:{free_port()}"
    processes.start("open", "serve", "m.json", "-l", endpoint, "--insecure")
    processes.wait_for("open", "a1 is not here")
    lines = processes.said("open").splitlines()
    assert len(lines) >= 2
    assert all("INSECURE, anybody may steer: " in line for line in lines)


@pytest.mark.slow
def test_ten_thousand_forged_messages_a_second_are_not_accepted_and_no_period_is_missed(processes, join, fleet):
    """Half are plans by another agent's certificate, half states of an agent by its own, without its signing key."""
    raw = json.loads(small_mission(12.0).to_json())
    (processes.folder / "m.json").write_text(json.dumps(raw))
    processes.serve("--speed", "1")
    for name in ("a1", "a2"):
        processes.agent(name, "--speed", "1")
    processes.wait_for("serve", "controller: flying")
    viewer, a1, a2 = join("viewer"), join("a1"), join("a2")
    states = viewer.inbox(KEYS.state("a1"), 4096, history=8)
    genuine = decode_state(until(states.drain)[-1].payload, 2)
    wrong = encode(msgspec.structs.replace(genuine, seq=2**40, position=[2.9, 3.9]))
    plan = straight_message(genuine)
    channels = [
        (a2._inner.publisher(KEYS.plan("a1"), bus.PLAN), sign(load(fleet, "a2").signing_key, KEYS.plan("a1"), plan)),
        (
            a1._inner.publisher(KEYS.state("a1"), bus.STATE),
            sign(load(fleet, "a2").signing_key, KEYS.state("a1"), wrong),
        ),
    ]
    begin, sent, pause = time.monotonic(), 0, Event()
    while time.monotonic() < begin + 5.0:
        for _ in range(10):
            for publisher, payload in channels:
                publisher.publish(payload)
                sent += 1
        pause.wait(max(0.0, begin + sent / 10_000 - time.monotonic()))
    assert sent > 40_000
    processes.wait_for("serve", "everything is covered and everyone is at rest")
    flown = [decode_state(item.payload, 2) for item in states.drain()]
    assert all(state.seq < 2**30 for state in flown)
    assert {state.plan.epoch for state in flown if state.plan} == {1}
    assert re.findall(r"(\d+) deadlines missed", processes.said("serve"))[-1] == "0"
    assert "too many messages: of a1" in processes.said("serve")


def straight_message(state):
    """Return a plan for an agent of an epoch that nobody has, to stay where it is."""
    rest = {"position": [state.position] * 2, "velocity": [[0.0, 0.0]] * 2, "input": [[0.0, 0.0]]}
    times = {"start_s": state.time_s, "valid_until_s": state.time_s + 100.0, "period_s": 0.5}
    identity = {"agent": "a1", "instance": state.instance, "controller": "forger"}
    return encode(PlanMessage(epoch=1000, seq=0, **identity, **times, **rest))


@pytest.mark.slow
def test_a_demo_without_a_controller_flies_with_keys(start, fleet):
    demo = start(swarm_mission(agents=2, size=3.0), "--controller", "potential", "--speed", "8", "--credentials", fleet)
    assert demo.end(0)["outcome"] == "everything is covered"
