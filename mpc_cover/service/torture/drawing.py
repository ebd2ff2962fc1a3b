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
_LIES_S = (2.0, 12.0)
_LAG_PERIODS = (1.0, 15.0)
_LATE_PERIODS = (0.5, 10.0)
_BROKEN_PERIODS = (1.0, 12.0)
_STEP_S = 3600.0
_DRIFT = 5e-5
"""Rates of monotonic clocks differ from true time by up to this: as crystals do."""
_CONTROLLER_DIES = 0.25
_MIXED_SHARE = 0.35
FOR_GOOD_S = 1e6
"""Ranges of durations, probabilities and amounts, FOR_GOOD_S of what lasts for the whole flight: plain choices, around
what the scoreboard in docs/reliability.md asks for."""


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
        together = {
            FaultKind.LOSS: self._loss,
            FaultKind.DELAY: self._delay,
            FaultKind.REORDER: self._reorder,
            FaultKind.DUPLICATES: self._duplicates,
            FaultKind.CLOCKS: self._clocks,
            FaultKind.DEATHS: self._deaths,
            FaultKind.DISK: self._disk,
            FaultKind.TAKEOVERS: self._takeover,
        }
        single = {
            FaultKind.BURSTS: self._burst,
            FaultKind.CUTS: self._cut,
            FaultKind.STOPS: self._stop,
            FaultKind.RESTARTS: self._restart,
            FaultKind.SLOW: self._slow,
            FaultKind.FROZEN: self._frozen,
            FaultKind.TWINS: self._twin,
            FaultKind.SOLVER: self._solver,
        }
        if kind in together:
            return together[kind]()
        return [single[kind]() for _ in range(self._chance.choice((1, 1, 2, 3)))]

    def _burst(self) -> Fault:
        some = tuple(self._chance.sample(self._ids, self._chance.randint(1, min(2, len(self._ids)))))
        way = self._chance.choice(("state", "plan", "both"))
        return Fault(FaultKind.BURSTS, self._when(), self._chance.uniform(*_BURST_S), some, way=way)

    def _cut(self) -> Fault:
        whom, lasts_s = self._anyone(), self._chance.uniform(*_CUT_S)
        waits, half_open = self._perhaps(), self._perhaps()
        return Fault(FaultKind.CUTS, self._when(), lasts_s, whom, held=waits, keeps_token=half_open)

    def _stop(self) -> Fault:
        whom, lasts_s = self._anyone(), self._chance.uniform(*_STOP_S)
        waits, keeps = self._perhaps(), self._perhaps()
        return Fault(FaultKind.STOPS, self._when(), lasts_s, whom, held=waits, keeps_token=keeps)

    def _restart(self) -> Fault:
        whom = (self._chance.choice((*self._ids, CONTROLLER, CONTROLLER)),)
        way, share = self._chance.choice(("at once", "publishing")), self._chance.random()
        return Fault(FaultKind.RESTARTS, self._when(), self._chance.uniform(*_RESTART_S), whom, share, way=way)

    def _takeover(self) -> list[Fault]:
        lasts_s = self._chance.uniform(*_STOP_S)
        return [Fault(FaultKind.TAKEOVERS, self._when(), lasts_s, (CONTROLLER,), held=self._perhaps())]

    def _slow(self) -> Fault:
        whom = (self._chance.choice((*self._ids, CONTROLLER)),)
        lag_s = self._chance.uniform(*_LAG_PERIODS) * self._state_period_s
        return Fault(FaultKind.SLOW, self._when(), self._chance.uniform(*_LIES_S), whom, delay_s=lag_s)

    def _frozen(self) -> Fault:
        whom = (self._chance.choice(self._ids),)
        return Fault(FaultKind.FROZEN, self._when(), self._chance.uniform(*_LIES_S), whom)

    def _twin(self) -> Fault:
        whom = (self._chance.choice(self._ids),)
        return Fault(FaultKind.TWINS, self._when(), self._chance.uniform(*_LIES_S), whom)

    def _solver(self) -> Fault:
        way = self._chance.choice((*SOLVER_FAULTS, "collides", "collides", "scatters"))  # the worst more often
        late_s = self._chance.uniform(*_LATE_PERIODS) * self._period_s
        lasts_s = self._chance.uniform(*_BROKEN_PERIODS) * self._period_s
        return Fault(FaultKind.SOLVER, self._when(), lasts_s, way=way, delay_s=late_s)

    def _loss(self) -> list[Fault]:
        return [Fault(FaultKind.LOSS, 0.0, FOR_GOOD_S, share=self._chance.uniform(0.05, _LOSS_MAX))]

    def _delay(self) -> list[Fault]:
        constant_s = self._chance.uniform(0.0, _DELAY_S)
        return [self._late(FaultKind.DELAY, constant_s, self._chance.uniform(0.0, _DELAY_S - constant_s))]

    def _reorder(self) -> list[Fault]:
        return [self._late(FaultKind.REORDER, 0.0, self._chance.uniform(0.05, _DELAY_S))]

    def _late(self, kind: FaultKind, constant_s: float, random_s: float) -> Fault:
        begin_s = 0.0 if self._perhaps() else self._when()
        whom = () if self._perhaps() else (self._chance.choice(self._ids),)
        return Fault(kind, begin_s, FOR_GOOD_S, whom, delay_s=constant_s, jitter_s=random_s)

    def _duplicates(self) -> list[Fault]:
        share, later_s = self._chance.uniform(0.1, 0.9), self._chance.choice((0.0, 0.1, 2.0))
        return [Fault(FaultKind.DUPLICATES, 0.0, FOR_GOOD_S, share=share, delay_s=later_s)]

    def _clocks(self) -> list[Fault]:
        steps_s = {name: self._chance.choice((-_STEP_S, _STEP_S)) for name in (*self._ids, CONTROLLER)}
        return [
            Fault(FaultKind.CLOCKS, self._when(), targets=(name,), delay_s=step_s, jitter_s=_DRIFT)
            for name, step_s in steps_s.items()
        ]

    def _deaths(self) -> list[Fault]:
        """Return who dies for good: the controller, or agents of which one is left."""
        agents = self._chance.sample(self._ids, self._chance.randint(1, max(1, len(self._ids) - 1)))
        mortal = [CONTROLLER] if self._chance.random() < _CONTROLLER_DIES else agents
        return [Fault(FaultKind.DEATHS, self._when(), targets=(name,), way="at once") for name in mortal]

    def _disk(self) -> list[Fault]:
        """Return a disk that fails, and a restart of the controller meanwhile or later, which needs it."""
        way, start_s, lasts_s = self._chance.choice(("full", "torn")), self._when(), self._chance.uniform(1.0, 8.0)
        dies_s = self._chance.uniform(start_s, start_s + lasts_s)
        disk = Fault(FaultKind.DISK, start_s, lasts_s, (CONTROLLER,), way=way)
        return [
            disk,
            Fault(FaultKind.RESTARTS, dies_s, self._chance.uniform(*_RESTART_S), (CONTROLLER,), way="at once"),
        ]

    def _anyone(self) -> tuple[str]:
        """Return the name of a process; agents are twice as likely as the controller."""
        return (self._chance.choice((*self._ids, *self._ids, CONTROLLER)),)

    def _perhaps(self) -> bool:
        return bool(self._chance.getrandbits(1))

    def _when(self) -> float:
        return self._chance.uniform(0.5, self._lasts_s)
