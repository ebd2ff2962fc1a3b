"""Checks that a sealed recording is what was written, link by link of its chain."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpc_cover.record_seal import digest_of, seal_of
from mpc_cover.verification.report import Check, CheckName

if TYPE_CHECKING:
    from mpc_cover.trajectory_file import Recording


def check_seal(trajectory: Recording) -> Check | None:
    """Check the seal of a recording; None where it bears none, as plans and simulations."""
    if (seal := seal_of(trajectory)) is None:
        return None
    samples = int(trajectory.time.size)
    if seal.samples != samples:
        where = f"{samples} samples, and {seal.samples} were sealed"
        return Check(CheckName.SEAL, holds=False, margin=float("-inf"), unit="", where=where)
    holds = _digest(trajectory) == seal.digest
    by = f"signed by {seal.key}, which is not looked at" if seal.signature else "unsigned"
    where = f"{samples} samples, {by}" if holds else "its facts or samples were changed after it was sealed"
    return Check(CheckName.SEAL, holds=holds, margin=0.0 if holds else float("-inf"), unit="", where=where)


def _digest(trajectory: Recording) -> str:
    try:
        return digest_of(trajectory)
    except ValueError:  # arrays of sizes that do not fit together
        return ""
