"""Whatever arrives is decoded or rejected with a reason; nothing else."""

import contextlib
import json

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpc_cover.service.protocol import decoding
from mpc_cover.service.protocol.decoding import MAX_PAYLOAD, Reason, RejectedError
from mpc_cover.service.protocol.messages import (
    CommandReply,
    CommandRequest,
    Event,
    MapMessage,
    Phase,
    PlanMessage,
    PlanRef,
    State,
    Status,
    encode,
)

STATE = State(
    agent="a1",
    instance="i",
    seq=3,
    time_s=1.5,
    position=[1.0, 2.0],
    velocity=[0.0, 0.1],
    plan=PlanRef(1, 2),
    at_rest=False,
)
PLAN = PlanMessage(
    epoch=1,
    controller="c",
    seq=0,
    agent="a1",
    instance="i",
    start_s=1.0,
    valid_until_s=1.5,
    period_s=0.5,
    position=[[0.0, 0.0]] * 3,
    velocity=[[0.0, 0.0]] * 3,
    input=[[0.0, 0.0]] * 2,
)
STATUS = Status(
    controller="c", epoch=1, seq=0, phase=Phase.FLYING, mission_time_s=1.0, covered_count=1, cell_count=2, text="ok"
)
MAP = MapMessage(controller="c", epoch=1, mission_time_s=0.0, cell_count=9, covered_count=2, bits="ff80")
EVENT = Event(source="a1", seq=0, time_s=0.0, kind="start", text="flies")
CASES = {
    "state": (STATE, lambda data: decoding.decode_state(data, 2)),
    "plan": (PLAN, lambda data: decoding.decode_plan(data, 2)),
    "status": (STATUS, decoding.decode_status),
    "map": (MAP, decoding.decode_map),
    "event": (EVENT, decoding.decode_event),
    "request": (CommandRequest(request="r1"), decoding.decode_request),
    "reply": (CommandReply(request="r1", accepted=True, phase=Phase.WAITING), decoding.decode_reply),
}
every_message = pytest.mark.parametrize(("message", "decode"), CASES.values(), ids=CASES)
every_decoder = pytest.mark.parametrize("decode", [decode for _, decode in CASES.values()], ids=CASES)


def changed(message, **fields) -> bytes:
    return json.dumps({**json.loads(encode(message)), **fields}).encode()


def reason(decode, payload) -> Reason:
    with pytest.raises(RejectedError) as caught:
        decode(payload)
    return caught.value.reason


@every_message
def test_what_is_encoded_comes_back(message, decode):
    assert decode(encode(message)) == message


@every_message
def test_fields_of_a_later_version_are_skipped(message, decode):
    assert decode(changed(message, something_new={"deep": [1, 2]})) == message


@every_message
@pytest.mark.parametrize("version", [0, 2, 10**30, -1, "1", None, 1.5])
def test_another_schema_is_rejected(message, decode, version):
    assert reason(decode, changed(message, schema=version)) in (Reason.SCHEMA, Reason.MALFORMED)


@every_message
def test_oversize_is_rejected_without_a_look(message, decode):
    assert reason(decode, encode(message) + b" " * MAX_PAYLOAD) is Reason.OVERSIZE


@every_decoder
@pytest.mark.parametrize(
    "payload",
    [b"", b"{}", b"[]", b"null", b"\xff\xfe", b'{"schema": 1}', b"[" * 100_000, b'{"schema":1,"a":' + b"[" * 90_000],
)
def test_garbage_is_rejected(decode, payload):
    assert reason(decode, payload) is Reason.MALFORMED


@every_message
def test_every_truncation_is_rejected(message, decode):
    payload = encode(message)
    for length in range(len(payload)):
        assert reason(decode, payload[:length]) is Reason.MALFORMED


@every_decoder
@given(payload=st.binary(max_size=300))
def test_bytes_never_crash(decode, payload):
    with pytest.raises(RejectedError):
        decode(payload)


junk = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=8,
)


@every_message
@given(data=st.data(), value=junk)
def test_a_field_of_any_value_never_crashes(message, decode, data, value):
    field = data.draw(st.sampled_from(sorted(msgspec.structs.asdict(message))))
    with contextlib.suppress(RejectedError):
        decode(changed(message, **{field: value}))


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999", "-1e999"])
@pytest.mark.parametrize("field", ["time_s", "position", "velocity"])
def test_a_state_that_is_not_finite_is_rejected(number, field):
    value = number if field == "time_s" else f"[0.0, {number}]"
    raw = encode(STATE).replace(
        json.dumps(json.loads(encode(STATE))[field], separators=(",", ":")).encode(), value.encode(), 1
    )
    assert number.encode() in raw
    assert reason(lambda data: decoding.decode_state(data, 2), raw) in (Reason.NOT_FINITE, Reason.MALFORMED)


@pytest.mark.parametrize("field", ["position", "velocity"])
@pytest.mark.parametrize("vector", [[], [1.0], [1.0, 2.0, 3.0], [1.0, 2.0, 3.0, 4.0]])
def test_a_state_of_another_dimension_is_rejected(field, vector):
    payload = changed(STATE, **{field: vector})
    assert reason(lambda data: decoding.decode_state(data, 2), payload) in (Reason.SHAPE, Reason.MALFORMED)


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ({"reference_position": [0.0, 1.0]}, Reason.SHAPE),
        ({"reference_velocity": [0.0, 1.0]}, Reason.SHAPE),
        ({"reference_position": [0.0], "reference_velocity": [0.0, 1.0]}, Reason.SHAPE),
        ({"reference_position": [0.0, 1.0], "reference_velocity": [0.0, "x"]}, Reason.MALFORMED),
    ],
)
def test_a_reference_has_two_parts_of_the_right_shape(fields, why):
    assert reason(lambda data: decoding.decode_state(data, 2), changed(STATE, **fields)) is why


def test_a_state_with_a_reference_comes_back():
    state = msgspec.structs.replace(STATE, reference_position=[1.0, 2.1], reference_velocity=[0.0, 0.2])
    assert decoding.decode_state(encode(state), 2) == state
    raw = encode(state).replace(b"2.1", b"1e999")
    assert reason(lambda data: decoding.decode_state(data, 2), raw) in (Reason.NOT_FINITE, Reason.MALFORMED)


@pytest.mark.parametrize(
    "fields",
    [
        {"period_s": 0.0},
        {"period_s": -0.5},
        {"input": [[0.0, 0.0]] * 3},
        {"position": [[0.0, 0.0]] * 2},
        {"velocity": [[0.0, 0.0]] * 4},
        {"velocity": [[0.0, 0.0], [0.0], [0.0, 0.0]]},
    ],
)
def test_a_plan_of_another_shape_is_rejected(fields):
    assert reason(lambda data: decoding.decode_plan(data, 2), changed(PLAN, **fields)) is Reason.SHAPE


@pytest.mark.parametrize("bits", ["ff", "ff8000", "xy00", "ff8"])
def test_a_map_whose_bits_do_not_fit_is_rejected(bits):
    assert reason(decoding.decode_map, changed(MAP, bits=bits)) in (Reason.SHAPE, Reason.MALFORMED)
