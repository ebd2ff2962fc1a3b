"""What the controller believes of its agents' states: nothing old, repeated, misdirected or impossible."""

import json

import numpy as np
import pytest
from service_fakes import Bench, small_mission
from sweep_laws import StraightSweepLaw

from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.decoding import Reason
from mpc_cover.service.protocol.messages import Phase, encode


def test_repeated_and_reordered_states_are_rejected_and_the_map_is_the_same(mission):
    def fly(channel):
        bench, law = Bench(mission, channel), StraightSweepLaw(mission)
        for name in ("a1", "a2"):
            bench.agent(name)
        controller = bench.controller(law)
        bench.run(controller, until=lambda: controller.done)
        return controller.coverage.first, controller.fleet_monitor.rejected

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
    bench.run(controller, until=lambda: controller.phase is Phase.FLYING)
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


@pytest.mark.parametrize(
    ("others", "options", "text"),
    [
        ({}, {"speed": 2.0}, "a1 runs at --speed 1, this controller at 2"),
        ({"time_limit_s": 17.0}, {}, "a1 has another version of this mission"),
    ],
)
def test_different_speeds_and_missions_are_told(bench, law, others, options, text):
    for name in ("a1", "a2"):
        bench.agent(name, mission=small_mission(**others))
    controller = bench.controller(law, **options)
    bench.run(controller, seconds=2.0)
    assert controller.heartbeat.text.startswith(text)
    assert not law.states


def test_reports_are_late_by_the_delay_and_clocks_are_still_known_exactly():
    bench = Bench(small_mission(disturbance={"delay_s": 0.25}))
    bench.agent("a1")
    inbox = bench.hear(bench.keys.state("a1"))
    bench.run(seconds=1.0)
    delays = [item.received_s for item in inbox.drain()]
    np.testing.assert_allclose(delays, 100.25 + 0.1 * np.arange(len(delays)) - 0.1 * (np.arange(len(delays)) > 0))
    bench.agent("a2")
    controller = bench.controller(StraightSweepLaw(bench.mission))
    bench.run(controller, until=lambda: controller.done)
    assert [link.offset for link in controller.fleet_monitor.links] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert controller.exit_status == 0


def test_a_former_process_that_comes_back_goes_on_where_it_was_and_a_recording_of_it_does_not(bench, fleet, law):
    """The first hangs, another one takes its place and hangs, too; then all that the first has said is said again."""
    controller, monitor = (made := bench.controller(law)), made.fleet_monitor
    bench.run(controller, seconds=1.0)
    said = [item.payload for item in bench.hear(bench.keys.state("a1")).drain()]
    first, record = fleet[0], bench.bus.join().publisher(bench.keys.state("a1"), bus.Quality("DATA"))
    bench.agents.remove(first)
    other = bench.agent("a1", instance="second-life")
    bench.run(controller, seconds=2.5)
    assert monitor.links[0].state.instance == "second-life"
    bench.agents.remove(other)
    bench.run(controller, seconds=2.0)
    for payload in said:
        record.publish(payload)
    bench.run(controller, seconds=0.6)
    assert monitor.links[0].state.instance == "second-life"
    assert monitor.rejected[Reason.OLD] == len(said)
    bench.agents.append(first)
    bench.run(controller, seconds=1.0)
    assert monitor.links[0].state.instance == first.instance
