"""The channel: when copies of messages arrive, under each kind of fault."""

import itertools

import pytest

from mpc_cover.service.torture.channel import LATENCY_S, Channel
from mpc_cover.service.torture.faults import Fault, FaultKind

STATE, PLAN = "cover/m/agent/a1/state", "cover/m/agent/a1/plan"


def arrivals(*faults: Fault, count=400, every_s=0.1, source="a1", target="controller", key=STATE, seed="s"):
    """Return the arrivals of messages sent every `every_s`, and when they were sent."""
    channel = Channel(faults, seed)
    sent = [every_s * number for number in range(count)]
    return [channel.arrivals(source, target, key, at_s) for at_s in sent], sent


def test_without_faults_each_arrives_once_after_the_latency():
    found, sent = arrivals()
    assert found == [[at_s + LATENCY_S] for at_s in sent]


def test_a_share_of_them_is_lost_each_time_the_same():
    fault = Fault(FaultKind.LOSS, 0.0, 1e6, share=0.3)
    found, _ = arrivals(fault)
    lost = sum(not each for each in found)
    assert 0.2 < lost / len(found) < 0.4
    assert arrivals(fault)[0] == found
    assert arrivals(fault, seed="another")[0] != found


def test_another_fault_changes_nothing_of_what_is_drawn():
    loss, burst = Fault(FaultKind.LOSS, 0.0, 1e6, share=0.3), Fault(FaultKind.BURSTS, 50.0, 5.0, ("a2",))
    assert arrivals(loss)[0] == arrivals(burst, loss)[0]


@pytest.mark.parametrize(("way", "states", "plans"), [("state", 0, 1), ("plan", 1, 0), ("both", 0, 0)])
def test_a_burst_loses_all_of_its_way_while_it_lasts(way, states, plans):
    fault = Fault(FaultKind.BURSTS, 1.0, 2.0, ("a1",), way=way)
    for key, source, target, left in ((STATE, "a1", "controller", states), (PLAN, "controller", "a1", plans)):
        found, sent = arrivals(fault, count=50, source=source, target=target, key=key)
        assert all(len(each) == (left if 1.0 <= at_s < 3.0 else 1) for each, at_s in zip(found, sent, strict=True))
    others, _ = arrivals(fault, count=50, source="a2", target="controller")
    assert all(others)


@pytest.mark.parametrize("held", [False, True])
def test_a_cut_parts_one_process_from_all_others_both_ways(held):
    fault = Fault(FaultKind.CUTS, 1.0, 2.0, ("a1",), held=held)
    for source, target in (("a1", "controller"), ("controller", "a1"), ("a2", "a1")):
        found, sent = arrivals(fault, count=50, source=source, target=target)
        during = [each for each, at_s in zip(found, sent, strict=True) if 1.0 <= at_s < 3.0]
        assert during == ([[3.0 + LATENCY_S]] * len(during) if held else [[]] * len(during))
    others, _ = arrivals(fault, count=50, source="a2", target="controller")
    assert all(others)
    channel = Channel([fault], "s")
    assert channel.cut_off("a1", "a2", 2.0) is fault
    assert channel.cut_off("a1", "a2", 3.0) is None
    assert channel.cut_off("controller", "a2", 2.0) is None


def test_delays_keep_the_order_and_reordering_does_not():
    delayed, sent = arrivals(Fault(FaultKind.DELAY, 0.0, 1e6, delay_s=0.4, jitter_s=0.3))
    times = [each[0] for each in delayed]
    assert times == sorted(times)
    assert all(0.4 <= time_s - at_s <= 0.7 + LATENCY_S + 1e-9 for time_s, at_s in zip(times, sent, strict=True))
    mixed, _ = arrivals(Fault(FaultKind.REORDER, 0.0, 1e6, jitter_s=0.3))
    assert any(later[0] < earlier[0] for earlier, later in itertools.pairwise(mixed))


def test_duplicates_come_with_the_message_or_later():
    found, _ = arrivals(Fault(FaultKind.DUPLICATES, 0.0, 1e6, share=0.5, delay_s=2.0))
    assert {1, 2, 3} <= {len(each) for each in found}
    assert all(0.0 <= copy_s - each[0] <= 2.0 for each in found for copy_s in each)
