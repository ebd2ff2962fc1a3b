"""The fingerprint by which missions of the same name are distinguished."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpc_cover.mission.load import Mission


def mission_hash(mission: Mission) -> str:
    """Return the SHA-256 of the whole specification, in hexadecimal."""
    return hashlib.sha256(mission.to_json().encode()).hexdigest()
