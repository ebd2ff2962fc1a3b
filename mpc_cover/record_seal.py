"""The seal of a recording: a chain of digests over its facts and each of its samples, and the signer's word for it.

Link 0 is the SHA-256 of what the file states besides the motion: mission, agents, losses, coverage, seed. Link n + 1 is
that of link n and sample n: its time, positions, velocities and inputs, rounded to single precision, so that a copy in
single precision keeps its seal. Whoever changes, drops or adds a sample or a fact changes the last link. Nobody needs
a secret to compute it: without a signature the seal protects from accidents and careless edits, not from forgers.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray
    from mpc_cover.trajectory_file import Recording

    Signer = Callable[[bytes], tuple[str, str]]
    """Returns the name of its key, and its signature of a digest, both as text."""

KEY = "seal"
"""Where the seal is in a recording's `meta`."""


@dataclass(frozen=True)
class Seal:
    """A recording's seal as its file has it: the last link in hexadecimal, the number of samples, key and signature."""

    digest: str
    samples: int
    key: str = ""
    signature: str = ""


def digest_of(recording: Recording) -> str:
    """Return the last link of a recording's chain, in hexadecimal."""
    spec = recording.mission.spec.model_dump(mode="json", by_alias=True, exclude_defaults=True)
    facts = {name: value for name, value in recording.meta.items() if name != KEY}
    stated = json.dumps([spec, list(recording.agent_id), facts], sort_keys=True).encode()
    link = hashlib.sha256(stated + _bytes(recording.cell) + _bytes(recording.covered_at)).digest()
    none = np.zeros_like(recording.input[:1])
    held = np.concatenate([recording.input, none])
    for sample in zip(recording.time, recording.position, recording.velocity, held, strict=True):
        link = hashlib.sha256(link + b"".join(_bytes(np.asarray(part)) for part in sample)).digest()
    return link.hex()


def sealed(recording: Recording, sign: Signer | None = None) -> Recording:
    """Return the recording with its seal in `meta`, signed where there is somebody to `sign` it."""
    digest = digest_of(recording)
    key, signature = sign(bytes.fromhex(digest)) if sign is not None else ("", "")
    seal = {"digest": digest, "samples": int(recording.time.size), "key": key, "signature": signature}
    return replace(recording, meta={**recording.meta, KEY: seal})


def seal_of(recording: Recording) -> Seal | None:
    """Return the seal that a recording bears; None where it bears none, an empty one where that is unreadable."""
    given: Any = recording.meta.get(KEY)
    if given is None:
        return None
    try:
        return Seal(str(given["digest"]), int(given["samples"]), str(given["key"]), str(given["signature"]))
    except (KeyError, TypeError, ValueError, OverflowError):
        return Seal("", 0)


def _bytes(values: FloatArray) -> bytes:
    with np.errstate(over="ignore"):
        return values.astype("<f4").tobytes()
