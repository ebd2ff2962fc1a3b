"""Decodes messages from untrusted bytes: whatever is wrong with them is a counted rejection, never a crash."""

from __future__ import annotations

import math
from enum import StrEnum
from typing import TYPE_CHECKING, TypeVar

import msgspec

from mpc_cover.service.protocol import messages
from mpc_cover.service.protocol.messages import (
    CommandReply,
    CommandRequest,
    Event,
    MapMessage,
    Message,
    PlanMessage,
    State,
    Status,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

MAX_PAYLOAD = 1 << 20
"""Largest payload that is decoded [bytes]: ten times a plan of 400 steps in three dimensions."""


class Reason(StrEnum):
    """Why a message was rejected."""

    OVERSIZE = "oversize"
    MALFORMED = "malformed"
    SCHEMA = "schema"
    UNSIGNED = "not signed"
    FORGED = "wrongly signed"
    FLOOD = "too many messages"
    NOT_FINITE = "not finite"
    SHAPE = "shape"
    WRONG_AGENT = "wrong agent"
    WRONG_INSTANCE = "wrong instance"
    OLD = "old or repeated"
    IMPLAUSIBLE = "implausible"
    OTHER_INSTANCE = "another process of the agent"
    OLD_EPOCH = "old epoch"
    FAR_EPOCH = "epoch too far ahead"
    OTHER_CONTROLLER = "other controller"
    EXPIRED = "expired"
    LIMITS = "limits"
    FENCE = "fence"
    DYNAMICS = "dynamics"
    NOT_AT_REST = "does not end at rest"
    START = "starts elsewhere"


class RejectedError(Exception):
    """A message that is not acted upon; `reason` is counted, the text gives details."""

    def __init__(self, reason: Reason, text: str = "") -> None:
        self.reason = reason
        super().__init__(f"{reason}: {text}" if text else str(reason))


M = TypeVar("M", bound=Message)


class _Version(msgspec.Struct):
    schema: int


_VERSION = msgspec.json.Decoder(_Version)
_DECODERS = {
    kind: msgspec.json.Decoder(kind)
    for kind in (State, PlanMessage, Status, MapMessage, Event, CommandRequest, CommandReply)
}


def decode_with(decoder: msgspec.json.Decoder[M], payload: bytes) -> M:
    """Return a message of this schema version, whatever its kind.

    Raises
    ------
    RejectedError
        It is too large, of another version, or no such message.
    """
    if len(payload) > MAX_PAYLOAD:
        raise RejectedError(Reason.OVERSIZE, f"{len(payload)} bytes")
    try:
        version = _VERSION.decode(payload).schema
        if version != messages.SCHEMA_VERSION:
            raise RejectedError(Reason.SCHEMA, f"version {version}, this is {messages.SCHEMA_VERSION}")
        return decoder.decode(payload)
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise RejectedError(Reason.MALFORMED, str(error)[:200]) from None


def _decode(kind: type[M], payload: bytes) -> M:
    decoded: M = decode_with(_DECODERS[kind], payload)  # type: ignore[index, assignment]
    return decoded


def require_finite(values: Iterable[float]) -> None:
    """Raise RejectedError for infinities and NaN."""
    if not all(map(math.isfinite, values)):
        raise RejectedError(Reason.NOT_FINITE)


def _require_shape(rows: Sequence[Sequence[float]], dimension: int) -> None:
    if any(len(row) != dimension for row in rows):
        raise RejectedError(Reason.SHAPE, f"each sample must have {dimension} coordinates")
    for row in rows:
        require_finite(row)


def decode_state(payload: bytes, dimension: int) -> State:
    """Return a state whose numbers are finite and whose vectors have `dimension` coordinates.

    Raises
    ------
    RejectedError
        It is anything else.
    """
    state = _decode(State, payload)
    require_finite((state.time_s, state.speed))
    reference = [row for row in (state.reference_position, state.reference_velocity) if row is not None]
    if len(reference) == 1:
        raise RejectedError(Reason.SHAPE, "a reference has a position and a velocity")
    _require_shape((state.position, state.velocity, *reference), dimension)
    return state


def decode_plan(payload: bytes, dimension: int) -> PlanMessage:
    """Return a plan with finite numbers, consistent shapes and a positive period.

    Raises
    ------
    RejectedError
        It is anything else.
    """
    plan = _decode(PlanMessage, payload)
    require_finite((plan.start_s, plan.valid_until_s, plan.period_s))
    if plan.period_s <= 0.0:
        raise RejectedError(Reason.SHAPE, f"period_s {plan.period_s} must be greater than 0")
    steps = len(plan.input)
    if len(plan.position) != steps + 1 or len(plan.velocity) != steps + 1:
        raise RejectedError(Reason.SHAPE, "N inputs need N + 1 positions and velocities")
    for rows in (plan.position, plan.velocity, plan.input):
        _require_shape(rows, dimension)
    return plan


def decode_status(payload: bytes) -> Status:
    """Return a status; RejectedError when it is none."""
    status = _decode(Status, payload)
    places = (x for place in status.standing.values() for x in place)
    require_finite((status.mission_time_s, status.step_ms, *places, *status.still_in_s.values()))
    return status


def decode_map(payload: bytes) -> MapMessage:
    """Return a coverage map whose bits fit its cell count; RejectedError when it is none."""
    message = _decode(MapMessage, payload)
    require_finite((message.mission_time_s,))
    try:
        size = len(bytes.fromhex(message.bits))
    except ValueError:
        raise RejectedError(Reason.MALFORMED, "bits must be hexadecimal") from None
    if size != (message.cell_count + 7) // 8:
        raise RejectedError(Reason.SHAPE, f"{size} bytes of bits for {message.cell_count} cells")
    return message


def decode_event(payload: bytes) -> Event:
    """Return an event; RejectedError when it is none."""
    event = _decode(Event, payload)
    require_finite((event.time_s,))
    return event


def decode_request(payload: bytes) -> CommandRequest:
    """Return a command; RejectedError when it is none."""
    return _decode(CommandRequest, payload)


def decode_reply(payload: bytes) -> CommandReply:
    """Return the reply to a command; RejectedError when it is none."""
    return _decode(CommandReply, payload)
