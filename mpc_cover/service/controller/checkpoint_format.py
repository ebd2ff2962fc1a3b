"""The bytes of a checkpoint: a checksum, which tells damage, and a MAC, without which it is not believed.

The MAC is HMAC-SHA256 under the secret of the state directory: without one, anybody who may write a file could say that
everything is covered.
"""

from __future__ import annotations

import hashlib
import hmac
import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from mpc_cover.service.controller.snapshot import Snapshot

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mpc_cover.arrays import FloatArray

SCHEMA = 2
DAMAGED = "is damaged"


class _Header(msgspec.Struct, frozen=True):
    """Header of a checkpoint; the map's arrays follow in the order of `shapes` as little-endian doubles."""

    mission: str
    generation: int
    mission_time_s: float
    finished: bool
    shapes: dict[str, tuple[int, ...]]
    origins: dict[str, float]
    schema: int = SCHEMA
    lost: dict[str, list[float]] = {}
    heard: dict[str, int] = {}
    versions: list[str] = []
    epoch: int = 0


def pack(snapshot: Snapshot, mission: str, generation: int, secret: bytes) -> bytes:
    """Return the bytes of a checkpoint: a checksum and a MAC, a header, the map."""
    header = _Header(
        mission,
        generation,
        snapshot.mission_time_s,
        snapshot.finished,
        {name: array.shape for name, array in snapshot.map.items()},
        snapshot.origins,
        lost=snapshot.lost,
        heard=snapshot.heard,
        versions=snapshot.versions,
        epoch=snapshot.epoch,
    )
    arrays = b"".join(array.astype("<f8").tobytes() for array in snapshot.map.values())
    payload = msgspec.json.encode(header) + b"\n" + arrays
    checksum = hashlib.sha256(payload).hexdigest()
    return f"{checksum} {_mac(payload, secret)}\n".encode() + payload


def _mac(payload: bytes, secret: bytes) -> str:
    return hmac.new(secret, payload, hashlib.sha256).hexdigest()


def flaw_of(data: bytes, secret: bytes) -> str:
    """Return what is wrong with the bytes of a checkpoint: damaged, or whole and not authentic; empty for nothing."""
    head, end, payload = data.partition(b"\n")
    checksum, _, mac = head.partition(b" ")
    if not end or hashlib.sha256(payload).hexdigest().encode() != checksum:
        return DAMAGED
    if not mac:
        return "bears no authentication, as those of earlier versions"
    if not hmac.compare_digest(_mac(payload, secret).encode(), mac):
        return "is not authentic: somebody without the secret of this folder wrote it, or the secret is another one"
    return ""


def unpack(data: bytes, secret: bytes) -> tuple[str, int, Snapshot] | None:
    """Return mission hash, generation and snapshot, or None when the bytes are damaged or not authentic."""
    if flaw_of(data, secret):
        return None
    payload = data.partition(b"\n")[2]
    try:
        head, _, arrays = payload.partition(b"\n")
        header = msgspec.json.decode(head, type=_Header)
        kept = _arrays(np.frombuffer(arrays, dtype="<f8"), header.shapes)
    except (msgspec.MsgspecError, ValueError):
        return None  # written by another program or version
    known = header.origins, header.lost, header.heard, header.versions, header.epoch
    snapshot = Snapshot(header.mission_time_s, kept, header.finished, *known)
    return header.mission, header.generation, snapshot


def _arrays(values: FloatArray, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, FloatArray]:
    """Split the concatenated doubles into arrays of these shapes; raise ValueError if they do not fit."""
    ends = np.cumsum([math.prod(shape) for shape in shapes.values()])
    if values.size != (ends[-1] if ends.size else 0):
        raise ValueError("other sizes")
    parts = np.split(values.astype(float), ends[:-1])
    return {name: part.reshape(shape) for (name, shape), part in zip(shapes.items(), parts, strict=True)}
