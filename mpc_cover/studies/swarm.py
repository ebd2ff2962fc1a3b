"""Simulates the distributed law in one process: each agent with its own map, delayed by the network (chapters 5, 6)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.distributed.potential_functions import coordination_of
from mpc_cover.distributed.potential_law import Bounds, PotentialLaw, random_signal
from mpc_cover.distributed.stall_escape import StallEscape
from mpc_cover.information.ageing import AgeingMap
from mpc_cover.mission.config import Dynamics
from mpc_cover.studies.swarm_knowledge import Knowledge
from mpc_cover.studies.swarm_record import MapRecord, SwarmRecord

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.mission.field import Field
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.studies.swarm_parameters import Scenario, SwarmParameters


def run(scenario: Scenario, seed: int) -> SwarmRecord:
    """Fly a scenario from a random start; the same seed gives the same record."""
    fleet, field = scenario.build(np.random.default_rng([seed, 0]))
    return fly(fleet, field, scenario.swarm, seed)


def fly(fleet: Fleet, field: Field, parameters: SwarmParameters, seed: int) -> SwarmRecord:
    """Fly a fleet by the distributed law until every agent knows that everything is measured, or time is up.

    Parameters
    ----------
    fleet, field : of a mission; rho_B of 0 and rho_C of inf ask for neither.
    parameters : of the simulation.
    seed : of the random signal, the field to be estimated, its readings, and the order of escapes.

    Raises
    ------
    ValueError
        Bounds that contradict each other.
    """
    knowledge = Knowledge(fleet, field, parameters, seed)
    motion = _Motion(fleet, field, parameters, seed)
    log = _Log(parameters, fleet.size)
    last = int(np.ceil(parameters.time_limit_s / parameters.period_s - 1e-9))
    for sample in range(last + 1):
        time = sample * parameters.period_s
        knowledge.observe(sample, time, motion.position)
        log.map(sample, time, knowledge)
        done = sample == last or knowledge.settled
        kept, here, velocity = motion.kept(), motion.position, motion.velocity
        force = np.zeros_like(here)
        if not done:
            velocity, force = motion.move(knowledge.weights(), kept)
        log.add(time, here, velocity, force, kept, knowledge)
        if done:
            break
    return log.record(fleet, field, knowledge, seed)


class _Motion:
    """The fleet's state, and one step of the law."""

    def __init__(self, fleet: Fleet, field: Field, parameters: SwarmParameters, seed: int) -> None:
        self._double = parameters.dynamics == Dynamics.DOUBLE
        self.position, self.velocity = fleet.start.copy(), np.zeros_like(fleet.start)
        self._period = parameters.period_s
        coordination = coordination_of(fleet, parameters.repel_within_m, parameters.attract_beyond_m)
        force = fleet.input_max if self._double else None
        bounds = Bounds(fleet.speed_max, force, fleet.motion_min, fleet.motion_max)
        self._law = PotentialLaw(field.cell, bounds, coordination, parameters.law, parameters.period_s)
        self._signal = np.random.default_rng([seed, 3])
        order = np.random.default_rng([seed, 4]).permutation(field.size)
        patience = parameters.patience_s / parameters.period_s
        self._escape = [StallEscape(order, patience) for _ in fleet.ids]
        self._connected = np.isfinite(fleet.communication_range)
        self._value, self._links = field.weight, fleet.links

    def kept(self) -> BoolArray:
        """Return (m, m): edges that agent i (row) keeps from here on."""
        if not self._connected:
            return np.zeros((len(self.position),) * 2, dtype=bool)
        kept = self._law.kept_edges(self.position, self.velocity)
        for one, two in self._links:  # 4.19
            kept[one, two] = kept[two, one] = True
        return kept

    def move(self, weight: FloatArray, kept: BoolArray) -> tuple[FloatArray, FloatArray]:
        """Move one step by (m, K) gamma; return the velocities at its start and the inputs held, each (m, d)."""
        here, begun = self.position, self.velocity
        weighed = weight * self._value
        gamma = np.array([escape.attend(row) for escape, row in zip(self._escape, weighed, strict=True)])
        desired = self._law.desired_velocity(here, gamma, kept, random_signal(self._signal, *here.shape))
        if not self._double:
            self.position = self._law.step(here, desired, kept)
            return (self.position - here) / self._period, np.zeros_like(here)
        force = self._law.force(here, begun, desired, kept)
        self.position = here + self._period * begun + 0.5 * self._period**2 * force
        self.velocity = begun + self._period * force
        return begun, force


class _Log:
    """The log of a simulation, sample by sample."""

    def __init__(self, parameters: SwarmParameters, agents: int) -> None:
        self._parameters, self._agents = parameters, agents
        self._rows: list[tuple[float, FloatArray, FloatArray, FloatArray, BoolArray]] = []
        self._left: list[float] = []
        self._own: list[list[float]] = []
        self._age: list[tuple[float, float]] = []
        self._maps: list[tuple[float, FloatArray, FloatArray, FloatArray]] = []

    def add(
        self,
        time: float,
        position: FloatArray,
        velocity: FloatArray,
        force: FloatArray,
        kept: BoolArray,
        knowledge: Knowledge,
    ) -> None:
        """Log a sample."""
        self._rows.append((time, position, velocity, force, kept))
        self._left.append(knowledge.left(knowledge.true))
        shared = all(each is knowledge.true for each in knowledge.own)
        self._own.append([self._left[-1]] * self._agents if shared else [knowledge.left(e) for e in knowledge.own])
        if isinstance(knowledge.true, AgeingMap):
            self._age.append((knowledge.true.worst_age, knowledge.true.mean_age))

    def map(self, sample: int, time: float, knowledge: Knowledge) -> None:
        """Log the maps, at every few samples."""
        every = self._parameters.maps_every
        if every > 0 and sample % every == 0:
            self._maps.append((time, knowledge.true.residual.sum(axis=0), knowledge.weights(), knowledge.estimates()))

    def record(self, fleet: Fleet, field: Field, knowledge: Knowledge, seed: int) -> SwarmRecord:
        """Return the record of all samples."""
        time, position, velocity, force, kept = (np.array(column) for column in zip(*self._rows, strict=True))
        age = np.array(self._age).reshape(-1, 2)
        true = knowledge.true
        never = np.full(field.size, np.inf)
        return SwarmRecord(
            parameters=self._parameters,
            seed=seed,
            fleet=fleet,
            field=field,
            time=time,
            position=position,
            velocity=velocity,
            input=force[:-1],
            residual=np.array(self._left),
            own_residual=np.array(self._own),
            kept=kept,
            covered_at=never if isinstance(true, AgeingMap) else true.covered_at,
            worst_age=age[:, 0],
            mean_age=age[:, 1],
            truth=knowledge.truth,
            maps=self._map_record(field.size),
        )

    def _map_record(self, cells: int) -> MapRecord:
        if not self._maps:
            return MapRecord(np.empty(0), np.empty((0, cells)), np.empty((0, 0, cells)), np.empty((0, 0, 0)))
        time, true, own, estimate = (np.array(column) for column in zip(*self._maps, strict=True))
        return MapRecord(time, true, own, estimate)
