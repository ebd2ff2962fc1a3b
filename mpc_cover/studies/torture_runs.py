"""The flights of `mpc-cover torture`: each seed's faults, what became of it, and the fewest faults that do it."""

from __future__ import annotations

import time
from functools import partial
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from mpc_cover.mission.load import mission_from_json
from mpc_cover.service.torture.drawing import draw, nominal_s
from mpc_cover.service.torture.faults import LASTING_S, Fault, FaultKind
from mpc_cover.service.torture.oracle import Violation  # noqa: TC001 - likewise
from mpc_cover.service.torture.world import fly

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.torture.world import Outcome

MIXED = "mixed"
"""Kind of a flight with faults of several kinds."""
CLEAN_SEED = -1
"""Stands for the flight without faults, with which the others are compared."""
_LIMIT_FACTOR, _LIMIT_MORE_S = 5.0, 40.0
"""A flight ends after so many times about what it takes without faults, and so much longer [s]; plain choices."""
_SHORTEST_S = 0.05
"""Faults are not shrunk below this duration [s]; a plain choice, about half a state period."""
_HALVINGS = 4
"""How often the duration of a fault is halved at most; a plain choice: then it takes a sixteenth."""


class TortureRun(msgspec.Struct, frozen=True):
    """One flight: everything that determines it. `kinds` are those that faults are drawn from."""

    mission: str
    backend: str
    kinds: tuple[FaultKind, ...]
    seed: int


class TortureRecord(msgspec.Struct, frozen=True):
    """What became of a flight.

    Attributes
    ----------
    seed, kind, faults : the flight; the kind is "mixed" where there are several, empty without faults.
    finished, text, covered_s : how it ended; None for what never ended.
    violations, smallest_m : what the oracle saw.
    digest : the same flight has the same.
    cpu_s : processor time that it took [s].
    """

    seed: int
    kind: str
    faults: tuple[Fault, ...]
    finished: bool
    text: str
    covered_s: float | None
    violations: tuple[Violation, ...]
    smallest_m: float
    digest: str
    cpu_s: float


def faults_of(mission: Mission, kinds: Sequence[FaultKind], seed: int) -> tuple[str, tuple[Fault, ...]]:
    """Return the kind of a seed's faults, and the faults."""
    if seed == CLEAN_SEED:
        return "", ()
    kind, faults = draw(mission, kinds, seed)
    return MIXED if kind is None else str(kind), faults


def flight_of(mission: Mission, faults: Sequence[Fault], seed: int, backend: str) -> Outcome:
    """Fly a mission under faults, for as long as a study waits for it."""
    return fly(mission, faults, seed, limit_s=_LIMIT_FACTOR * nominal_s(mission) + _LIMIT_MORE_S, backend=backend)


def torture(run: TortureRun) -> TortureRecord:
    """Fly a run in any process."""
    mission = mission_from_json(run.mission, "the mission")
    kind, faults = faults_of(mission, run.kinds, run.seed)
    begun_s = time.process_time()
    outcome = flight_of(mission, faults, run.seed, run.backend)
    return TortureRecord(
        run.seed,
        kind,
        faults,
        outcome.finished,
        outcome.text,
        outcome.covered_s if np.isfinite(outcome.covered_s) else None,
        outcome.violations,
        outcome.smallest_m,
        outcome.digest,
        time.process_time() - begun_s,
    )


def shrunk(
    mission: Mission, faults: Sequence[Fault], seed: int, backend: str, *, on_try: Callable[[int, str], None]
) -> tuple[Fault, ...]:
    """Return the fewest faults that lead to the same kind of violation, each as short as halving finds.

    `on_try` is called before each flight with its number and what is tried.
    """
    wanted = {violation.what for violation in flight_of(mission, faults, seed, backend).violations}
    tries = 0

    def fails(some: Sequence[Fault], what: str) -> bool:
        nonlocal tries
        tries += 1
        on_try(tries, what)
        found = {violation.what for violation in flight_of(mission, some, seed, backend).violations}
        return bool(found & wanted)

    left = list(faults)
    for fault in faults:
        fewer = [other for other in left if other is not fault]
        if fewer and fails(fewer, f"without {fault.text}"):
            left = fewer
    for index, fault in enumerate(left):
        left[index] = _shortest(fault, partial(_with, left, index, fails))
    return tuple(left)


def _with(left: Sequence[Fault], index: int, fails: Callable[[Sequence[Fault], str], bool], other: Fault) -> bool:
    return fails([*left[:index], other, *left[index + 1 :]], f"with {other.text}")


def _shortest(fault: Fault, fails: Callable[[Fault], bool]) -> Fault:
    for _ in range(_HALVINGS):
        shorter = _halved(fault)
        if shorter is None or not fails(shorter):
            break
        fault = shorter
    return fault


def _halved(fault: Fault) -> Fault | None:
    """Return a fault of half the duration; None for instants, and for faults that last for good."""
    lasts_s = 0.5 * fault.duration_s
    return msgspec.structs.replace(fault, duration_s=lasts_s) if _SHORTEST_S < lasts_s < LASTING_S else None
