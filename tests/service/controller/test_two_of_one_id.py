"""A second process that says it is an agent which is here already: it is turned away, and harms nobody."""

from mpc_cover.service.protocol.decoding import Reason
from mpc_cover.service.protocol.messages import Phase


def second(bench, name="a1"):
    """Start another process of an agent; return it, and its transport."""
    first, kept = bench.transports[name], bench.records[name]
    other = bench.agent(name, instance="second-life")
    transport, bench.transports[name], bench.records[name] = bench.transports[name], first, kept
    return other, transport


def test_the_second_is_told_whose_the_id_is_and_the_first_flies_on(bench, fleet, law):
    controller = bench.controller(law)
    bench.run(controller, until=lambda: controller.phase is Phase.FLYING)
    other, transport = second(bench)
    bench.run(controller, until=lambda: other.done, seconds=4.0)
    assert other.taken_by == fleet[0].instance
    bench.agents.remove(other)
    transport.close()
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0
    assert controller.supervisor.lost == []
    assert set(controller.fleet_monitor.rejected) == {Reason.OTHER_INSTANCE}
    assert "instance second-l says that it is a1, too" in " ".join(bench.said)
    assert not fleet[0].done


def test_one_that_leaves_before_the_start_leaves_the_first_in_its_place(bench, fleet, law):
    bench.kill(fleet[1])
    controller = bench.controller(law)
    bench.run(controller, seconds=1.0)
    other, transport = second(bench)
    bench.run(controller, seconds=1.0)
    bench.agents.remove(other)
    transport.close()
    bench.run(controller, seconds=1.0)
    assert controller.heartbeat.text == "a2 is not here"


def test_when_the_first_dies_the_second_takes_its_place_and_may_leave_it_again(bench, fleet, law):
    bench.kill(fleet[1])
    controller = bench.controller(law)
    bench.run(controller, seconds=1.0)
    other, transport = second(bench)
    bench.run(controller, seconds=0.3)
    bench.agents.remove(fleet[0])  # it hangs: its token stays
    bench.run(controller, seconds=1.8)
    assert controller.heartbeat.status.instances["a1"] == other.instance
    assert not other.taken_by
    bench.agents.append(fleet[0])  # it comes to itself
    bench.run(controller, seconds=1.0)
    assert controller.heartbeat.status.instances["a1"] == other.instance
    bench.agents.remove(other)
    transport.close()
    bench.run(controller, seconds=1.0)
    assert controller.heartbeat.status.instances["a1"] == fleet[0].instance, "it was replaced once, and is back"
    assert controller.heartbeat.text == "a2 is not here"
