"""What agents say to each other arrives as it was said, or is rejected with a reason."""

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from swarm_missions import swarm_mission

from mpc_cover.distributed.state_report import StateReport
from mpc_cover.service.protocol.decoding import MAX_PAYLOAD, Reason, RejectedError
from mpc_cover.service.protocol.messages import encode
from mpc_cover.service.swarm.radio_messages import Codec, Hello, Word

CODEC = Codec(swarm_mission())
number = st.floats(-1e6, 1e6)
vector = st.tuples(number, number).map(np.array)
reports = st.builds(
    StateReport,
    agent=st.integers(0, 2),
    sample=st.integers(0, 10**6),
    time_s=number,
    position=vector,
    velocity=vector,
    heard=st.frozensets(st.integers(0, 2)),
    promised=st.booleans(),
    looked=st.none() | vector,
    looked_s=number,
    complete=st.booleans(),
    readings=st.none() | st.lists(number, min_size=1, max_size=5).map(np.array),
)


def word(own, news=(), **changes):
    fields = {"agent": own.agent, "instance": "i", "mission": "m", "start_s": 0.0, "own": own, "news": tuple(news)}
    return Word(**{**fields, **changes})


@given(own=reports, news=st.lists(reports, max_size=3))
def test_a_word_arrives_as_it_was_said(own, news):
    said = word(CODEC.note(own), [CODEC.note(each) for each in news], missing=(1, 2, 3), owed=4, at_rest=True)
    got = CODEC.word(encode(said))
    assert got == said
    for before, note in zip((own, *news), (got.own, *got.news), strict=True):
        after = CODEC.report(note)
        for name in ("agent", "sample", "time_s", "heard", "promised", "looked_s", "complete"):
            assert getattr(after, name) == getattr(before, name)
        np.testing.assert_array_equal(after.position, before.position)
        np.testing.assert_array_equal(after.velocity, before.velocity)
        assert (after.looked is None) == (before.looked is None)
        assert (after.readings is None) == (before.readings is None)
        if before.readings is not None:
            np.testing.assert_array_equal(after.readings, before.readings)


@given(payload=st.binary(max_size=200) | st.text(max_size=100).map(str.encode))
def test_anything_else_is_rejected(payload):
    for decode in (CODEC.word, CODEC.hello):
        with pytest.raises(RejectedError):
            decode(payload)


GOOD = msgspec.json.decode(
    encode(word(CODEC.note(StateReport(0, 1, 0.5, np.zeros(2), np.zeros(2), looked=np.zeros(2), looked_s=0.0))))
)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"schema": 2}, Reason.SCHEMA),
        ({"agent": "a9"}, Reason.WRONG_AGENT),
        ({"agent": "a2"}, Reason.WRONG_AGENT),
        ({"missing": [1, 2]}, Reason.WRONG_AGENT),
        ({"own": {**GOOD["own"], "position": [1.0]}}, Reason.SHAPE),
        ({"own": {**GOOD["own"], "heard": ["a1", "zz"]}}, Reason.WRONG_AGENT),
        ({"own": {**GOOD["own"], "sample": -1}}, Reason.MALFORMED),
        ({"own": {**GOOD["own"], "time_s": "x"}}, Reason.MALFORMED),
        ({"news": [{**GOOD["own"], "looked": [0.0, 0.0, 0.0]}]}, Reason.SHAPE),
        ({"news": [{**GOOD["own"], "readings": [1.0, None]}]}, Reason.MALFORMED),
        ({"own": {**GOOD["own"], "readings": "1.0"}}, Reason.MALFORMED),
    ],
)
def test_reasons(change, reason):
    with pytest.raises(RejectedError) as caught:
        CODEC.word(msgspec.json.encode({**GOOD, **change}))
    assert caught.value.reason is reason


def test_numbers_must_be_finite_and_payloads_of_a_size():
    read = {**GOOD, "own": {**GOOD["own"], "readings": [0.125]}}
    for payload in (
        msgspec.json.encode(GOOD).replace(b'"start_s":0.0', b'"start_s":1e999'),
        msgspec.json.encode(read).replace(b"0.125", b"1e999"),
    ):
        with pytest.raises(RejectedError):
            CODEC.word(payload)
    with pytest.raises(RejectedError) as caught:
        CODEC.hello(b" " * (MAX_PAYLOAD + 1))
    assert caught.value.reason is Reason.OVERSIZE
    hello = Hello(
        agent="a1", instance="i", mission="m", seed=0, speed=1.0, time_s=0.0, position=[0.0, 0.0], present=("b",)
    )
    with pytest.raises(RejectedError) as caught:
        CODEC.hello(encode(hello))
    assert caught.value.reason is Reason.WRONG_AGENT
