"""How to fly a demo, and how one ended."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mpc_cover.verification.summary import RunSummary


@dataclass(frozen=True)
class DemoOptions:
    """How to fly: see `mpc-cover demo --help`; `deaths` is at which mission time [s] agents are killed, by id."""

    backend: str = "piqp"
    seed: int = 0
    speed: float = 1.0
    deaths: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class DemoResult:
    """How a demo ended: the exit status, in words, the summary unless nothing was flown, and who died."""

    exit_status: int
    outcome: str
    summary: RunSummary | None
    controller_restarts: int
    lost: tuple[str, ...] = ()
