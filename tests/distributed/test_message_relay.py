"""Every news once, and again what a neighbour still lacks."""

import numpy as np

from mpc_cover.distributed.message_relay import MOST_REPAIRS, MessageRelay
from mpc_cover.distributed.state_report import StateReport


def report(agent, sample, promised=False):
    return StateReport(agent, sample, 0.5 * sample, np.zeros(2), np.zeros(2), promised=promised)


def names(reports):
    return [(each.agent, each.sample) for each in reports]


def test_news_go_once():
    relay = MessageRelay(3)
    relay.forward(report(1, 0))
    relay.forward(report(1, 1, promised=True))
    assert names(relay.take()) == [(1, 0), (1, 1)]
    assert relay.take() == []


def test_what_a_neighbour_lacked_twice_is_sent_again():
    relay = MessageRelay(3)
    for sample in range(5):
        relay.forward(report(1, sample))
    relay.store(report(0, 0))
    relay.take()
    relay.note_missing(2, [0, 2, 0])
    assert relay.take() == [], "it may be on its way"
    relay.note_missing(2, [0, 2, 0])
    assert names(relay.take()) == [(0, 0), (1, 2), (1, 3), (1, 4)]
    relay.note_missing(2, [1, 5, 0])
    assert relay.take() == [], "it has arrived"


def test_a_long_gap_is_mended_a_part_at_a_time():
    relay = MessageRelay(2)
    for sample in range(200):
        relay.forward(report(1, sample))
    relay.take()
    lacks, seen = 0, set()
    relay.note_missing(0, [0, lacks])
    for _ in range(10):
        relay.note_missing(0, [0, lacks])
        again = names(relay.take())
        assert len(again) <= MOST_REPAIRS
        seen |= {sample for _, sample in again}
        lacks = max(seen) + 1 if seen else 0
        relay.note_missing(0, [0, lacks])
    assert seen == set(range(200))


def test_promises_are_not_kept():
    relay = MessageRelay(2)
    relay.forward(report(1, 0, promised=True))
    relay.take()
    for _ in range(2):
        relay.note_missing(0, [0, 0])
    assert relay.take() == []
