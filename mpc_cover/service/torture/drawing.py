"""Draws the faults of a flight from its seed, for a mission of which only the size matters."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.service.torture.faults import CONTROLLER, Fault, FaultKind
from mpc_cover.service.torture.faulty_law import SOLVER_FAULTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.mission.load import Mission

_LOSS_MAX = 0.5
"""Most of all messages that are lost independently; the scoreboard asks for 0.3."""
_BURST_S = (0.5, 6.0)
_CUT_S = (1.0, 12.0)
_DELAY_S = 0.75
"""Longest delay of a message [s], constant and random part together."""
_STOP_S = (0.1, 12.0)
_RESTART_S = (2.0, 10.0)
_STEP_S = 3600.0
_DRIFT = 5e-5
"""Rates of monotonic clocks differ from true time by up to this: as crystals do."""
_MIXED_SHARE = 0.35
"""Share of flights with faults of several kinds, where several are asked for. All of these are plain choices, from what
the scoreboard asks for."""


def nominal_s(mission: Mission) -> float:
    """Return about how long a mission takes [s]: half as long again as its swaths, all flown at full speed."""
    fleet = mission.fleet
    radius = np.where(np.isfinite(fleet.radius), fleet.radius, 0.0).max(axis=1)
    rate = float((2.0 * radius * fleet.speed_max).sum())
    cell = mission.spec.area.cell_size_m
    return 1.5 * mission.field.size * cell**2 / rate + 3.0


def draw(mission: Mission, kinds: Sequence[FaultKind], seed: int) -> tuple[FaultKind | None, tuple[Fault, ...]]:
    """Return the kind of a seed's faults, None for several kinds, and the faults."""
    chance = random.Random(f"{mission.spec.name}/{seed}/faults")  # noqa: S311 - reproducible, no secret
    pencil = _Pencil(mission, chance)
    if len(kinds) > 1 and chance.random() < _MIXED_SHARE:
        some = chance.sample(list(kinds), min(len(kinds), chance.choice((2, 2, 3))))
        return None, _sorted([fault for kind in some for fault in pencil.faults(kind)])
    kind = kinds[seed % len(kinds)]
    return kind, _sorted(pencil.faults(kind))


def _sorted(faults: list[Fault]) -> tuple[Fault, ...]:
    return tuple(sorted(faults, key=lambda fault: fault.start_s))


class _Pencil:
    """Draws faults of a mission."""

    def __init__(self, mission: Mission, chance: random.Random) -> None:
        self._ids, self._chance = list(mission.fleet.ids), chance
        self._period_s, self._state_period_s = mission.spec.control.period_s, mission.spec.control.state_period_s
        self._lasts_s = nominal_s(mission)

    def faults(self, kind: FaultKind) -> list[Fault]:
        """Return the faults of a kind: one or several."""
        chance = self._chance
        match kind:
            case FaultKind.LOSS:
                return [Fault(kind, 0.0, self._for_good, share=chance.uniform(0.05, _LOSS_MAX))]
            case FaultKind.DELAY:
                constant = chance.uniform(0.0, _DELAY_S)
                return [self._delay(kind, constant, chance.uniform(0.0, _DELAY_S - constant))]
            case FaultKind.REORDER:
                return [self._delay(kind, 0.0, chance.uniform(0.05, _DELAY_S))]
            case FaultKind.DUPLICATES:
                share, later_s = chance.uniform(0.1, 0.9), chance.choice((0.0, 0.1, 2.0))
                return [Fault(kind, 0.0, self._for_good, share=share, delay_s=later_s)]
            case FaultKind.CLOCKS:
                return [self._step(name) for name in (*self._ids, CONTROLLER)]
            case FaultKind.DEATHS:
                return [Fault(kind, self._when(), targets=(name,), way="at once") for name in self._mortal()]
            case FaultKind.DISK:
                return self._disk()
            case _:
                return [self._one(kind) for _ in range(chance.choice((1, 1, 2, 3)))]

    def _one(self, kind: FaultKind) -> Fault:
        chance, start_s = self._chance, self._when()
        match kind:
            case FaultKind.BURSTS:
                some = tuple(chance.sample(self._ids, chance.randint(1, min(2, len(self._ids)))))
                way = chance.choice(("state", "plan", "both"))
                return Fault(kind, start_s, chance.uniform(*_BURST_S), some, way=way)
            case FaultKind.CUTS:
                half_open, waits = chance.random() < 0.4, chance.random() < 0.3  # noqa: PLR2004 - plain choices
                whom = (chance.choice((*self._ids, *self._ids, CONTROLLER)),)
                return Fault(kind, start_s, chance.uniform(*_CUT_S), whom, held=waits, keeps_token=half_open)
            case FaultKind.STOPS:
                whom = (chance.choice((*self._ids, *self._ids, CONTROLLER)),)
                waits, keeps = chance.random() < 0.5, chance.random() < 0.5  # noqa: PLR2004 - likewise
                return Fault(kind, start_s, chance.uniform(*_STOP_S), whom, held=waits, keeps_token=keeps)
            case FaultKind.RESTARTS:
                whom = (chance.choice((*self._ids, CONTROLLER, CONTROLLER)),)
                way = chance.choice(("at once", "publishing"))
                return Fault(kind, start_s, chance.uniform(*_RESTART_S), whom, chance.random(), way=way)
            case FaultKind.SLOW:
                whom = (chance.choice((*self._ids, CONTROLLER)),)
                lag_s = chance.uniform(1.0, 15.0) * self._state_period_s
                return Fault(kind, start_s, chance.uniform(2.0, 15.0), whom, delay_s=lag_s)
            case FaultKind.FROZEN | FaultKind.TWINS:
                return Fault(kind, start_s, chance.uniform(2.0, 10.0), (chance.choice(self._ids),))
            case _:
                way, late_s = chance.choice(SOLVER_FAULTS), chance.uniform(0.5, 10.0) * self._period_s
                return Fault(kind, start_s, chance.uniform(0.0, 4.0) + self._period_s, way=way, delay_s=late_s)

    def _disk(self) -> list[Fault]:
        """Return a disk that fails, and a restart of the controller meanwhile or later, which needs it."""
        way, start_s, lasts_s = self._chance.choice(("full", "torn")), self._when(), self._chance.uniform(1.0, 8.0)
        dies_s = self._chance.uniform(start_s, start_s + lasts_s)
        disk = Fault(FaultKind.DISK, start_s, lasts_s, (CONTROLLER,), way=way)
        return [
            disk,
            Fault(FaultKind.RESTARTS, dies_s, self._chance.uniform(*_RESTART_S), (CONTROLLER,), way="at once"),
        ]

    def _delay(self, kind: FaultKind, constant_s: float, random_s: float) -> Fault:
        begin_s = 0.0 if self._chance.random() < 0.5 else self._when()  # noqa: PLR2004 - a plain choice
        whom = () if self._chance.random() < 0.5 else (self._chance.choice(self._ids),)  # noqa: PLR2004 - likewise
        return Fault(kind, begin_s, self._for_good, whom, delay_s=constant_s, jitter_s=random_s)

    def _step(self, name: str) -> Fault:
        step_s = self._chance.choice((-_STEP_S, _STEP_S))
        return Fault(FaultKind.CLOCKS, self._when(), targets=(name,), delay_s=step_s, jitter_s=_DRIFT)

    def _mortal(self) -> list[str]:
        """Return who dies for good: the controller, or agents of which one is left."""
        if self._chance.random() < 0.25:  # noqa: PLR2004 - a plain choice
            return [CONTROLLER]
        return self._chance.sample(self._ids, self._chance.randint(1, max(1, len(self._ids) - 1)))

    def _when(self) -> float:
        return self._chance.uniform(0.5, self._lasts_s)

    @property
    def _for_good(self) -> float:
        return 1e6
