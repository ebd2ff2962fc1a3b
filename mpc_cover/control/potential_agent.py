"""One agent that runs the distributed law by itself: it hears neighbours, relays what it knows, and stays safe.

Once a sample every agent sends its state and the news that it has not passed on yet, hears those within rho_C,
decides on its input, and promises the state that it leads to before it applies it. What an agent knows of those
farther away is as old as the way is long (5.2.1.1).

Silence is harmless as long as nobody acts on it: an agent that misses a neighbour's state of this sample brakes,
for which the neighbour's safe set leaves room (`stopping_filter`), and so does one that a neighbour has not heard, by
that neighbour's own word. A neighbour that stays silent is taken for lost: by then it is at rest, in the stopping
ball of the state it promised last. Whoever is known, but neither heard nor waited for, is an obstacle where it was
heard of last, and no part of the tree.
What is assumed: two agents hear each other once between rho_C and the distance at which they could meet.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from mpc_cover.control.escape import Escape
from mpc_cover.control.potential_law import Bounds, LawParameters, PotentialLaw, random_signal
from mpc_cover.control.stopping_filter import stopping_balls
from mpc_cover.information.delayed_map import HeardMap, TakesLooks

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.control.potential import Coordination
    from mpc_cover.information.looks import Sensing
    from mpc_cover.mission.field import Field
    from mpc_cover.mission.fleet import Fleet


@dataclass(frozen=True, eq=False)
class Report:
    """An agent's state at a sample: what is sent, and relayed.

    Attributes
    ----------
    agent : index in the fleet.
    sample : 0, 1, ...
    time_s : mission time [s].
    position, velocity : (d,) [m], [m/s].
    heard : whose state of the sample before the agent knew when it decided then.
    promised : whether the state is one to come, made known before the agent acts on it.
    """

    agent: int
    sample: int
    time_s: float
    position: FloatArray
    velocity: FloatArray
    heard: frozenset[int] = frozenset()
    promised: bool = False


@dataclass(frozen=True)
class AgentParameters:
    """How an agent runs the law.

    Attributes
    ----------
    law : its tuning; the edges kept are always the agent's own choice, for which it needs no one's word.
    period_s : T_s.
    patience : samples without news after which one cell counts only (`escape`).
    lost_after : samples of silence after which a neighbour is taken for lost; it must be at rest by then.
    lost_margin_m : how far a lost agent may be outside that ball. 0 where silence means that its process has
        ended and it braked; where a radio may fail one way, it had two more samples to act: 2 T_s v_max and the
        braking distance.
    """

    law: LawParameters
    period_s: float
    patience: int = 20
    lost_after: int = 6
    lost_margin_m: float = 0.0


_LEAVES_AFTER = 2
"""Samples for which a silent neighbour is expected that may just have left the range."""

M = TypeVar("M", bound=TakesLooks)


class PotentialAgent(Generic[M]):
    """An agent of a fleet.

    Parameters
    ----------
    fleet, field : the mission's; every agent knows them.
    index : which agent of the fleet this is.
    known : this agent's own map, still empty.
    sensing : which cells are in range of whom.
    coordination : rho_B, R_B, rho_C, R_C.
    parameters : how to run.
    order : (K,) the fleet's common order of escapes.
    rng : of this agent's random signal.

    Attributes
    ----------
    known : the map, which over-estimates what is left.
    lost : (m,) who is taken for lost.
    """

    def __init__(
        self,
        fleet: Fleet,
        field: Field,
        index: int,
        known: M,
        sensing: Sensing,
        *,
        coordination: Coordination,
        parameters: AgentParameters,
        order: IntArray,
        rng: np.random.Generator,
    ) -> None:
        self._fleet, self._field, self._index, self._rng = fleet, field, index, rng
        self._sensing, self._parameters, self._coordination = sensing, parameters, coordination
        self._able = (fleet.radius[index] > 0.0).astype(float)
        self._heard = HeardMap(known, fleet.size)
        self._escape = Escape(order, parameters.patience)
        self._newest: dict[int, Report] = {}
        self._promised: dict[int, Report] = {}
        self._news: list[Report] = []
        self._reach = fleet.communication_range
        self._near: set[int] = set()
        self._leaving: set[int] = set()
        self._silence: IntArray = np.zeros(fleet.size, dtype=np.intp)
        self._heard_before: frozenset[int] = frozenset()
        self.known = known
        self.lost: BoolArray = np.zeros(fleet.size, dtype=bool)

    def hear(self, reports: Iterable[Report]) -> None:
        """Take what a neighbour sent: its own state or promise, and its news. Repeats and old ones do no harm."""
        for report in reports:
            if report.promised:
                last = self._promised.get(report.agent)
                if last is None or report.sample > last.sample:
                    self._promised[report.agent] = report
                    self._news.append(report)
                continue
            looks = self._sensing.looks(report.time_s, report.position[None], np.array([report.agent]))
            if not self._heard.hear(report.agent, report.sample, looks):
                continue
            self._news.append(report)
            known = self._newest.get(report.agent)
            if known is None or report.sample > known.sample:
                self._newest[report.agent] = report
                self.lost[report.agent] = False

    def news(self) -> list[Report]:
        """Return what was learnt since the last call, to be sent to the neighbours with the own state."""
        fresh, self._news = self._news, []
        return fresh

    def report(self, sample: int, time_s: float, position: FloatArray, velocity: FloatArray) -> Report:
        """Return the own state as it is sent, and take it in."""
        own = Report(self._index, sample, time_s, position, velocity, self._heard_before)
        self.hear([own])
        return own

    def promise(self, own: Report, force: FloatArray) -> Report:
        """Return the state that an input (d,) [m/s^2] leads to, to be sent before it is applied."""
        period = self._parameters.period_s
        position = own.position + period * own.velocity + 0.5 * period**2 * force
        after = own.time_s + period
        return Report(self._index, own.sample + 1, after, position, own.velocity + period * force, promised=True)

    def decide(self, own: Report) -> FloatArray:
        """Return the input (d,) [m/s^2] to be held for a period from the own state that was sent."""
        if self._must_brake(own):
            brake = stopping_balls(
                own.position[None], own.velocity[None], self._fleet.input_max[[self._index]], self._parameters.period_s
            )
            return np.asarray(brake.force[0])
        rows = np.array(sorted(self._newest), dtype=np.intp)
        heard = np.array([self._newest[int(j)].sample == own.sample for j in rows])
        states = [self._newest[int(j)] if now else self._last_word(int(j)) for j, now in zip(rows, heard, strict=True)]
        position, velocity = np.array([each.position for each in states]), np.array([each.velocity for each in states])
        law = self._law_for(rows)
        kept = np.zeros((len(rows), len(rows)), dtype=bool)
        kept[np.ix_(heard, heard)] = self._law_for(rows[heard]).kept_edges(position[heard], velocity[heard])
        me = int(np.flatnonzero(rows == self._index)[0])
        weight = np.zeros((len(rows), self._field.size))
        weight[me] = self._escape.attend(self._field.weight * (self._able @ self.known.residual))
        wish = law.wish(position, weight, kept, random_signal(self._rng, len(rows), self._fleet.dimension))
        doubt = np.where(heard, 0.0, self._parameters.lost_margin_m)
        return np.asarray(law.force(position, velocity, wish, kept, doubt)[me])

    def _must_brake(self, own: Report) -> bool:
        """Return whether a neighbour is silent or has not heard this agent; remember whom to expect next."""
        others = {j: report for j, report in self._newest.items() if j != self._index}
        now = {j for j, report in others.items() if report.sample == own.sample}
        for j in others.keys() - now:
            self._bear_silence(j, own)
        unsure = any(j not in now or self._index not in others[j].heard for j in self._near)
        in_range = {j for j in now if np.linalg.norm(others[j].position - own.position) <= self._reach}
        self._near = (self._near - now) | in_range
        self._leaving -= now
        self._silence[list(now)] = 0
        self._heard_before = frozenset(now)
        return unsure

    def _bear_silence(self, j: int, own: Report) -> None:
        """Expect a silent neighbour for a while; then it has left the range, if it could, or is lost."""
        if j not in self._near:
            return
        self._silence[j] += 1
        away = float(np.linalg.norm(self._newest[j].position - own.position))
        if self._silence[j] == 1 and away + self._parameters.period_s * self._fleet.speed_max[j] > self._reach:
            self._leaving.add(j)
        if self._silence[j] > (_LEAVES_AFTER if j in self._leaving else self._parameters.lost_after):
            self._near.discard(j)
            self.lost[j] = j not in self._leaving

    def _last_word(self, j: int) -> Report:
        """Return the last state that a silent agent was heard to be in, or promised."""
        known, promised = self._newest[j], self._promised.get(j)
        return known if promised is None or promised.sample < known.sample else promised

    def _law_for(self, rows: IntArray) -> PotentialLaw:
        fleet = self._fleet
        bounds = Bounds(fleet.speed_max[rows], fleet.input_max[rows], fleet.motion_min, fleet.motion_max)
        parameters = replace(self._parameters.law, edges="own")
        return PotentialLaw(self._field.cell, bounds, self._coordination, parameters, self._parameters.period_s)
