"""The channel between two processes: when the copies of a message arrive, under the faults of a flight."""

from __future__ import annotations

import random
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from mpc_cover.service.torture.faults import Fault, FaultKind

if TYPE_CHECKING:
    from collections.abc import Sequence

LATENCY_S = 0.001
"""Delay of a message without faults [s]: of the order of loopback and small networks; a plain choice."""


class Channel:
    """Decides for each message when its copies arrive.

    What is drawn depends on the seed, the link and the message's number on it, so that other faults change nothing.
    """

    def __init__(self, faults: Sequence[Fault], seed: str) -> None:
        self._faults = [fault for fault in faults if fault.kind in _KINDS]
        self._seed = seed
        self._sent: Counter[tuple[str, str, str]] = Counter()
        self._last_s: dict[tuple[str, str, str], float] = {}

    def arrivals(self, source: str, target: str, key: str, now_s: float) -> list[float]:
        """Return when the copies of a message sent now arrive [s]; none when it is lost."""
        link = source, target, key
        number = self._sent[link]
        self._sent[link] += 1
        passage = _Passage(now_s + LATENCY_S)
        for fault in self._faults:
            if fault.on(now_s) and _concerns(fault, source, target, key):
                drawn = f"{self._seed}/{fault.kind}/{fault.start_s}/{link}/{number}"
                passage.pass_through(fault, random.Random(drawn))  # noqa: S311 - reproducible, no secret
        if passage.lost:
            return []
        if passage.in_order:
            passage.arrival_s = max(passage.arrival_s, self._last_s.get(link, 0.0))
            self._last_s[link] = passage.arrival_s
        return [passage.arrival_s + later_s for later_s in passage.copies]

    def cut_off(self, source: str, target: str, now_s: float) -> Fault | None:
        """Return the fault that parts two processes at present; None where nothing does."""
        for fault in self._faults:
            if fault.kind is FaultKind.CUTS and fault.on(now_s) and _parts(fault, source, target):
                return fault
        return None


_KINDS = {
    FaultKind.LOSS,
    FaultKind.BURSTS,
    FaultKind.CUTS,
    FaultKind.DELAY,
    FaultKind.REORDER,
    FaultKind.DUPLICATES,
}
_COPIES = 4
"""Most copies of a message; a plain choice."""


@dataclass
class _Passage:
    """A message on its way: when it arrives [s], whether no other overtakes it, and how much later its copies come."""

    arrival_s: float
    in_order: bool = True
    lost: bool = False
    copies: list[float] = field(default_factory=lambda: [0.0])

    def pass_through(self, fault: Fault, chance: random.Random) -> None:
        """Let a fault that lasts do to it what it does."""
        match fault.kind:
            case FaultKind.LOSS | FaultKind.BURSTS:
                self.lost |= chance.random() < fault.share
            case FaultKind.CUTS if fault.held:
                self.arrival_s = max(self.arrival_s, fault.end_s + LATENCY_S)
            case FaultKind.CUTS:
                self.lost = True
            case FaultKind.DUPLICATES:
                while chance.random() < fault.share and len(self.copies) < _COPIES:
                    self.copies.append(fault.delay_s * chance.random())
            case _:
                self.arrival_s += fault.delay_s + fault.jitter_s * chance.random()
                self.in_order &= fault.kind is FaultKind.DELAY


def _parts(fault: Fault, source: str, target: str) -> bool:
    """Return whether a cut lies between two processes."""
    return (source in fault.targets) != (target in fault.targets)


def _concerns(fault: Fault, source: str, target: str, key: str) -> bool:
    """Return whether a fault concerns messages on a key from one process to another."""
    if fault.kind is FaultKind.CUTS:
        return _parts(fault, source, target)
    if fault.way != "both" and not key.endswith(f"/{fault.way}"):
        return False
    return fault.strikes(source) or fault.strikes(target)
