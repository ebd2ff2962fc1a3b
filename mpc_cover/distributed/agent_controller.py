"""One agent that runs the distributed law by itself: it hears its neighbours, relays what it knows, and stays safe.

Once a sample every agent sends its state and the reports that it has not relayed yet, receives those of agents within
rho_C, decides on its input, and announces the state that the input leads to before applying it. What an agent knows of
those farther away is as old as the path to them is long (5.2.1.1).

An agent that falls silent makes its neighbours brake (`failure_detector`), and is finally taken for lost: by then it is
at rest, in the stopping ball of its last state, or of the state that it announced after that. Agents that are known,
but neither heard nor waited for, are obstacles in both balls, and no part of the tree.
Assumption: two agents hear each other at least once between rho_C and the distance at which they could meet.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from mpc_cover.distributed.delayed_measurements import DelayedMeasurements
from mpc_cover.distributed.desired_velocity import DesiredVelocity
from mpc_cover.distributed.failure_detector import NeighbourFailureDetector
from mpc_cover.distributed.message_relay import MessageRelay
from mpc_cover.distributed.neighbourhood import Neighbourhood, keep_links
from mpc_cover.distributed.potential_law import Bounds, EdgeRule, PotentialLaw
from mpc_cover.distributed.state_report import StateReport
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
    """The distributed controller of one agent of a fleet.

    Parameters
    ----------
    fleet, field : the mission's; every agent knows them.
    index : which agent of the fleet this is.
    known : this agent's own map, still empty.
    sensing : which cells are in range of each agent.
    sensor : the same with this agent's own readings, where the map asks for them; left out, it does not.
    coordination : rho_B, R_B, rho_C, R_C.
    parameters : how to run.
    order : (K,) the fleet's common order of escapes.
    rng : of this agent's random signal.
    double : double integrators, or single ones, whose input is their velocity.

    Attributes
    ----------
    known : the map, which over-estimates what is left.
    newest : the newest state report of each known agent, by index; before the first its start, as sample -1.

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
        self._fleet, self._field, self._index = fleet, field, index
        self._parameters, self._coordination = parameters, coordination
        self._double = double
        self._desired = DesiredVelocity(
            fleet, field, index, coordination=coordination, parameters=parameters, order=order, rng=rng
        )
        self._received = HeardMap(known, fleet.size)
        self._sensor = sensor
        self._measurements = DelayedMeasurements(known, sensing, parameters.delay, reads=sensor is not None)
        self._failures = NeighbourFailureDetector(fleet, index, parameters.period_s, parameters.lost_after)
        self._relay = MessageRelay(fleet.size)
        self._neighbourhood = Neighbourhood(
            fleet,
            parameters.period_s,
            double=double,
            lost_after=parameters.lost_after,
            margin_m=parameters.lost_margin_m,
        )
        self._promised: dict[int, StateReport] = {}
        rest = np.zeros(fleet.dimension)
        self.newest = {j: StateReport(j, -1, 0.0, at, rest) for j, at in enumerate(fleet.start) if j != index}
        self.known = known
        self._law_for(np.arange(fleet.size))

    @property
    def lost(self) -> BoolArray:
        """(m,) which agents are taken for lost."""
        return self._failures.lost

    def receive(self, reports: Iterable[StateReport]) -> None:
        """Take in what a neighbour sent: its own state or promise, and relayed reports. Repeated ones are harmless."""
        for report in reports:
            if report.promised:
                last = self._promised.get(report.agent)
                if last is None or report.sample > last.sample:
                    self._promised[report.agent] = report
                    self._relay.forward(report)
                continue
            if not self._received.note(report.agent, report.sample):
                continue
            self._relay.forward(report)
            self._measurements.receive(report, self._own_sample)
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
        """(m,) the first sample of each agent that has not been received."""
        return [self._received.missing(agent) for agent in range(self._fleet.size)]

    def receive_missing(self, neighbour: int, missing: Sequence[int]) -> None:
        """Note which samples a neighbour reports as not received: its `missing`."""
        self._relay.note_missing(neighbour, missing)

    def reports_to_relay(self) -> list[StateReport]:
        """Return reports received since the last call, and those that neighbours miss, to be sent with the own one."""
        return self._relay.take()

    def report(
        self,
        sample: int,
        time_s: float,
        position: FloatArray,
        velocity: FloatArray,
        looked: tuple[float, FloatArray | None] | None = None,
    ) -> StateReport:
        """Return the own state as it is sent, and take it in.

        `looked` is when [s] and where (d,) [m] the agent has measured; left out, at this sample.
        """
        when, where = (time_s, position) if looked is None else looked
        readings = None if self._sensor is None or where is None else self._read(self._sensor, when, where)
        seen = StateReport(
            self._index, sample, time_s, position, velocity, looked=where, looked_s=when, readings=readings
        )
        self._measurements.take(seen)
        self._measurements.release_due(sample)
        own = replace(
            seen,
            heard=self._failures.heard_before,
            complete=not (self.known.residual > 0.0).any(),
        )
        self._received.note(self._index, sample)
        self._relay.store(own)
        self.newest[self._index] = own
        return own

    def _read(self, sensor: Sensing, time_s: float, position: FloatArray) -> FloatArray | None:
        """Return what the own sensor reads of all that is in range of a (d,) position [m] at a mission time [s]."""
        return sensor.looks(time_s, position[None], np.array([self._index])).value

    def promise(self, own: StateReport, command: FloatArray) -> StateReport:
        """Return the state that an input (d,), as `decide` gives it, leads to; to be sent before it is applied."""
        period = self._parameters.period_s
        if self._double:
            position = own.position + period * own.velocity + 0.5 * period**2 * command
            velocity = own.velocity + period * command
        else:
            position, velocity = own.position + period * command, np.zeros_like(command)
        return StateReport(self._index, own.sample + 1, own.time_s + period, position, velocity, promised=True)

    def brake(self, own: StateReport) -> FloatArray:
        """Return the input (d,) that brakes, for which all safe sets leave room."""
        return self._neighbourhood.brake(own)

    def miss_deadline(self) -> None:
        """Let the next report say that no neighbour was heard: the time to decide has passed."""
        self._failures.heard_before = frozenset()

    def decide(self, own: StateReport) -> FloatArray:
        """Return the input (d,) to be held for a period from the own state that was sent.

        [m/s^2]; the velocity [m/s] of a single integrator. An agent that knows that nothing is owed stands still.
        """
        if self._failures.must_brake(own, self.newest) or own.complete:
            return self.brake(own)
        states, heard, uncertainty = self._neighbourhood.states(own, self.newest, self._promised)
        rows = np.array([each.agent for each in states], dtype=np.intp)
        position, velocity = np.array([each.position for each in states]), np.array([each.velocity for each in states])
        kept = np.zeros((len(rows), len(rows)), dtype=bool)
        kept[np.ix_(heard, heard)] = self._law_for(rows[heard]).kept_edges(position[heard], velocity[heard])
        keep_links(kept, rows, heard, self._fleet.links)
        me = int(np.flatnonzero(rows == self._index)[0])
        desired = np.zeros_like(position)
        towards = self._desired.towards_coverage(
            self._law_for(rows[heard]), self.known.residual, rows[heard], position[heard], kept[np.ix_(heard, heard)]
        )
        silent = [state for state, now in zip(states, heard, strict=True) if not now]
        desired[me] = self._desired.around_silent(towards, own, self._neighbourhood.balls(silent))
        law = self._law_for(rows)
        if not self._double:
            return np.asarray((law.step(position, desired, kept)[me] - own.position) / self._parameters.period_s)
        return np.asarray(law.force(position, velocity, desired, kept, uncertainty)[me])

    def _law_for(self, rows: IntArray) -> PotentialLaw:
        fleet = self._fleet
        force = fleet.input_max[rows] if self._double else None
        bounds = Bounds(fleet.speed_max[rows], force, fleet.motion_min, fleet.motion_max)
        parameters = replace(self._parameters.law, edges=EdgeRule.OWN)
        return PotentialLaw(self._field.cell, bounds, self._coordination, parameters, self._parameters.period_s)
