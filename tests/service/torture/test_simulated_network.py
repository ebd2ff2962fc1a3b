"""The simulated network: messages, history, and liveliness tokens."""

import pytest

from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.bus import NoAnswerError
from mpc_cover.service.torture.channel import Channel
from mpc_cover.service.torture.faults import Fault, FaultKind
from mpc_cover.service.torture.network import LEASE_S, SimulatedNetwork
from mpc_cover.service.torture.processes import Process
from mpc_cover.service.torture.virtual_time import VirtualTime


class Net:
    """A network, with one process for each name."""

    def __init__(self, *faults: Fault) -> None:
        self.time = VirtualTime()
        self.network = SimulatedNetwork(self.time, Channel(faults, "s"))
        for fault in faults:
            self.time.at(fault.start_s, lambda fault=fault: self.network.begin_silence(fault.targets))
            self.time.at(fault.end_s, lambda fault=fault: self.network.end_silence(fault.targets))

    def join(self, name: str):
        process = Process(name, self.time, 0.0)
        return process, self.network.join(process)

    def run(self, until_s: float) -> None:
        self.time.run(until_s, lambda: False)
        self.time.now_s = until_s


def test_what_is_published_arrives_a_latency_later_and_late_joiners_get_the_history():
    net = Net()
    _, one = net.join("one")
    _, two = net.join("two")
    inbox = two.inbox("k/*", 8)
    publisher = one.publisher("k/a", bus.PLAN)
    publisher.publish(b"1")
    assert inbox.drain() == []
    net.run(0.5)
    assert [(item.key, item.payload) for item in inbox.drain()] == [("k/a", b"1")]
    _, late = net.join("late")
    joined = late.inbox("k/*", 8, history=1)
    net.run(1.0)
    assert [item.payload for item in joined.drain()] == [b"1"]


def test_tokens_are_lost_at_once_with_a_process_and_with_the_lease_behind_a_cut():
    net = Net(Fault(FaultKind.CUTS, 2.0, 5.0, ("far",)))
    near, near_transport = net.join("near")
    _, far_transport = net.join("far")
    _, watcher = net.join("watcher")
    near_transport.announce("t/near")
    far_transport.announce("t/far")
    presence = watcher.presence("t/*")
    net.run(1.0)
    assert presence.alive() == {"t/near", "t/far"}
    net.time.at(1.5, near.kill)
    net.run(1.6)
    assert presence.alive() == {"t/far"}
    net.run(2.0 + LEASE_S - 0.1)
    assert presence.alive() == {"t/far"}
    assert watcher.alive("t/*", 1.0) == []
    net.run(2.0 + LEASE_S + 0.1)
    assert presence.alive() == frozenset()
    assert presence.lost_s("t/far") == pytest.approx(2.0 + LEASE_S)
    net.run(7.1)
    assert presence.alive() == {"t/far"}


def test_a_link_that_is_half_open_keeps_its_token():
    net = Net(Fault(FaultKind.CUTS, 2.0, 5.0, ("far",), keeps_token=True))
    _, far = net.join("far")
    _, watcher = net.join("watcher")
    far.announce("t/far")
    presence = watcher.presence("t/*")
    net.run(6.0)
    assert presence.alive() == {"t/far"}


@pytest.mark.parametrize("lost", [False, True])
def test_messages_to_a_stopped_process_wait_for_it_or_are_lost(lost):
    net = Net()
    _, one = net.join("one")
    process, two = net.join("two")
    inbox = two.inbox("k", 8)
    process.stop()
    if lost:
        net.network.stopped_lose.add(process)
    one.publisher("k", bus.STATE).publish(b"1")
    net.run(3.0)
    assert inbox.drain() == []
    process.proceed()
    assert [item.received_s for item in inbox.drain()] == ([] if lost else [3.0])


def test_a_process_dies_after_so_many_plans_and_says_nothing_more():
    net = Net()
    process, one = net.join("one")
    _, two = net.join("two")
    inbox = two.inbox("c/*/plan", 8)

    class Sender:
        done, next_time = False, 1.0

        def startup(self) -> None:
            one.dies_after = 2

        def tick(self) -> None:
            for name in "abc":
                one.publisher(f"c/{name}/plan", bus.PLAN).publish(b"p")

        def shutdown(self) -> None:
            process.clock.now()

    process.start(Sender)
    net.run(3.0)
    assert [item.key for item in inbox.drain()] == ["c/a/plan", "c/b/plan"]
    assert not process.alive


def test_the_trace_tells_what_was_sent_and_when_and_nobody_answers_requests():
    digests = []
    for at_s in (1.0, 1.0, 1.1):
        net = Net()
        _, one = net.join("one")
        publisher = one.publisher("a/state", bus.STATE)
        net.time.at(at_s, lambda publisher=publisher: publisher.publish(b"x"))
        net.run(2.0)
        digests.append(net.network.digest)
        with pytest.raises(NoAnswerError):
            one.ask("k", b"", 1.0)
    assert digests[0] == digests[1] != digests[2]
