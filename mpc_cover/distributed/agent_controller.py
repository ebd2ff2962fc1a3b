"""One agent that runs the distributed law by itself: it hears neighbours, relays what it knows, and stays safe.

Once a sample every agent sends its state and the news that it has not passed on yet, hears those within rho_C,
decides on its input, and promises the state that it leads to before it applies it. What an agent knows of those
farther away is as old as the way is long (5.2.1.1).

Whoever is silent makes its neighbours brake (`hearing`), and is taken for lost in the end: by then it is at rest, in
the stopping ball of its last state, or of the state that it promised after that. Whoever is known, but neither heard
nor waited for, is an obstacle in both, and no part of the tree.
What is assumed: two agents hear each other once between rho_C and the distance at which they could meet.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from mpc_cover.distributed.delayed_measurements import DelayedMeasurements
from mpc_cover.distributed.failure_detector import NeighbourFailureDetector
from mpc_cover.distributed.message_relay import MessageRelay
from mpc_cover.distributed.neighbourhood import Neighbourhood, keep_links
from mpc_cover.distributed.obstacle_detour import detour
from mpc_cover.distributed.potential_law import Bounds, PotentialLaw, random_signal
from mpc_cover.distributed.stall_escape import StallEscape
from mpc_cover.distributed.state_report import Report
from mpc_cover.information.delayed_map import HeardMap, TakesLooks

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.distributed.parameters import AgentParameters
    from mpc_cover.distributed.potential_functions import Coordination
    from mpc_cover.information.looks import Sensing
    from mpc_cover.mission.field import Field
    from mpc_cover.mission.fleet import Fleet


M = TypeVar("M", bound=TakesLooks)


class AgentController(Generic[M]):
    """An agent of a fleet.

    Parameters
    ----------
    fleet, field : the mission's; every agent knows them.
    index : which agent of the fleet this is.
    known : this agent's own map, still empty.
    sensing : which cells are in range of whom.
    sensor : the same with this agent's own readings, where the map asks for them; left out, it does not.
    coordination : rho_B, R_B, rho_C, R_C.
    parameters : how to run.
    order : (K,) the fleet's common order of escapes.
    rng : of this agent's random signal.
    double : double integrators, or single ones, whose input is their velocity.

    Attributes
    ----------
    known : the map, which over-estimates what is left.
    newest : the newest state of each agent that is known of, by index; before word of it its start, as sample -1.

    Raises
    ------
    ValueError
        Two agents that do not hear each other could meet within a step.
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
        double: bool = True,
        sensor: Sensing | None = None,
    ) -> None:
        self._fleet, self._field, self._index, self._rng = fleet, field, index, rng
        self._parameters, self._coordination = parameters, coordination
        self._double = double
        self._able = (fleet.radius[index] > 0.0).astype(float)
        self._heard = HeardMap(known, fleet.size)
        self._sensor = sensor
        self._looks = DelayedMeasurements(known, sensing, parameters.delay, reads=sensor is not None)
        self._escape = StallEscape(order, parameters.patience)
        self._hearing = NeighbourFailureDetector(fleet, index, parameters.period_s, parameters.lost_after)
        self._relay = MessageRelay(fleet.size)
        self._surroundings = Neighbourhood(
            fleet,
            parameters.period_s,
            double=double,
            lost_after=parameters.lost_after,
            margin_m=parameters.lost_margin_m,
        )
        self._promised: dict[int, Report] = {}
        rest = np.zeros(fleet.dimension)
        self.newest = {j: Report(j, -1, 0.0, at, rest) for j, at in enumerate(fleet.start) if j != index}
        self.known = known
        self._law_for(np.arange(fleet.size))

    @property
    def lost(self) -> BoolArray:
        """(m,) who is taken for lost."""
        return self._hearing.lost

    def hear(self, reports: Iterable[Report]) -> None:
        """Take what a neighbour sent: its own state or promise, and its news. Repeats and old ones do no harm."""
        for report in reports:
            if report.promised:
                last = self._promised.get(report.agent)
                if last is None or report.sample > last.sample:
                    self._promised[report.agent] = report
                    self._relay.learn(report)
                continue
            if not self._heard.note(report.agent, report.sample):
                continue
            self._relay.learn(report)
            self._looks.hear(report, self._own_sample)
            known = self.newest.get(report.agent)
            if known is None or report.sample > known.sample:
                self.newest[report.agent] = report
                self.lost[report.agent] = False

    @property
    def _own_sample(self) -> int:
        own = self.newest.get(self._index)
        return -1 if own is None else own.sample

    @property
    def lost_after(self) -> int:
        """Samples of silence after which a neighbour is taken for lost."""
        return self._parameters.lost_after

    @property
    def missing(self) -> list[int]:
        """(m,) the first sample of each agent that has not been heard."""
        return [self._heard.missing(agent) for agent in range(self._fleet.size)]

    def hear_lack(self, neighbour: int, missing: Sequence[int]) -> None:
        """Note what a neighbour says that it lacks: its `missing`."""
        self._relay.lacks(neighbour, missing)

    def news(self) -> list[Report]:
        """Return what was learnt since the last call and what neighbours lack, to be sent with the own state."""
        return self._relay.take()

    def report(
        self,
        sample: int,
        time_s: float,
        position: FloatArray,
        velocity: FloatArray,
        looked: tuple[float, FloatArray | None] | None = None,
    ) -> Report:
        """Return the own state as it is sent, and take it in.

        `looked` is when [s] and where (d,) [m] the agent has looked around; left out, at this sample.
        """
        when, where = (time_s, position) if looked is None else looked
        readings = None if self._sensor is None or where is None else self._read(self._sensor, when, where)
        seen = Report(self._index, sample, time_s, position, velocity, looked=where, looked_s=when, readings=readings)
        self._looks.take(seen)
        self._looks.catch_up(sample)
        own = replace(
            seen,
            heard=self._hearing.heard_before,
            complete=not (self.known.residual > 0.0).any(),
        )
        self._heard.note(self._index, sample)
        self._relay.keep(own)
        self.newest[self._index] = own
        return own

    def _read(self, sensor: Sensing, time_s: float, position: FloatArray) -> FloatArray | None:
        """Return what the own sensor reads of all that is in range of a (d,) position [m] at a mission time [s]."""
        return sensor.looks(time_s, position[None], np.array([self._index])).value

    def promise(self, own: Report, command: FloatArray) -> Report:
        """Return the state that an input (d,), as `decide` gives it, leads to; to be sent before it is applied."""
        period = self._parameters.period_s
        if self._double:
            position = own.position + period * own.velocity + 0.5 * period**2 * command
            velocity = own.velocity + period * command
        else:
            position, velocity = own.position + period * command, np.zeros_like(command)
        return Report(self._index, own.sample + 1, own.time_s + period, position, velocity, promised=True)

    def brake(self, own: Report) -> FloatArray:
        """Return the input (d,) that brakes, for which everyone's sets leave room."""
        return self._surroundings.brake(own)

    def miss(self) -> None:
        """Say in the next report that nobody was heard: the time to decide has passed."""
        self._hearing.heard_before = frozenset()

    def decide(self, own: Report) -> FloatArray:
        """Return the input (d,) to be held for a period from the own state that was sent.

        [m/s^2]; the velocity [m/s] of a single integrator. Whoever knows that nothing is owed stands still.
        """
        if self._hearing.unsure(own, self.newest) or own.complete:
            return self.brake(own)
        states, heard, doubt = self._surroundings.states(own, self.newest, self._promised)
        rows = np.array([each.agent for each in states], dtype=np.intp)
        position, velocity = np.array([each.position for each in states]), np.array([each.velocity for each in states])
        kept = np.zeros((len(rows), len(rows)), dtype=bool)
        kept[np.ix_(heard, heard)] = self._law_for(rows[heard]).kept_edges(position[heard], velocity[heard])
        keep_links(kept, rows, heard, self._fleet.links)
        me = int(np.flatnonzero(rows == self._index)[0])
        silent = [state for state, now in zip(states, heard, strict=True) if not now]
        wish = np.zeros_like(position)
        wish[me] = self._wish(own, (rows[heard], position[heard], kept[np.ix_(heard, heard)]), silent)
        law = self._law_for(rows)
        if not self._double:
            return np.asarray((law.step(position, wish, kept)[me] - own.position) / self._parameters.period_s)
        return np.asarray(law.force(position, velocity, wish, kept, doubt)[me])

    def _wish(self, own: Report, near: tuple[IntArray, FloatArray, BoolArray], silent: list[Report]) -> FloatArray:
        """Return the velocity (d,) [m/s] that the law asks for among those heard, around those who are silent.

        `near` are the (n,) agents heard, their (n, d) positions [m] and the (n, n) edges kept. The silent repel
        nobody: the safe sets keep them apart, and cells beside them may have to be measured.
        """
        rows, position, kept = near
        me = int(np.flatnonzero(rows == self._index)[0])
        weight = np.zeros((len(rows), self._field.size))
        weight[me] = self._escape.attend(self._field.weight * (self._able @ self.known.residual))
        signal = random_signal(self._rng, len(rows), self._fleet.dimension)
        wish = self._law_for(rows).wish(position, weight, kept, signal)[me]
        return self._around_silent(wish, own, silent) if self._escape.stalled else wish

    def _around_silent(self, wish: FloatArray, own: Report, states: list[Report]) -> FloatArray:
        """Return the velocity (d,) [m/s] that leads around those who are silent; in turns left and right of them."""
        if not states:
            return wish
        centre, radius = self._surroundings.balls(states)
        begins = max(self._coordination.repel_within_m, self._coordination.separation_m)
        near = radius + begins + self._parameters.period_s * self._fleet.speed_max[self._index]
        turn = 1.0 if own.sample // self._parameters.patience % 2 == 0 else -1.0
        return detour(wish, own.position, centre, near, turn)

    def _law_for(self, rows: IntArray) -> PotentialLaw:
        fleet = self._fleet
        force = fleet.input_max[rows] if self._double else None
        bounds = Bounds(fleet.speed_max[rows], force, fleet.motion_min, fleet.motion_max)
        parameters = replace(self._parameters.law, edges="own")
        return PotentialLaw(self._field.cell, bounds, self._coordination, parameters, self._parameters.period_s)
