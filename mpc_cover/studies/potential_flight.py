"""The thesis's potential law as a brain of the service: the same plant, the same map, a step at a time.

The law is distributed; here one place runs it for the whole fleet on the fleet's map, which spares it the delays
of a network. Its forces pass the stopping filter, so that separation and connectivity hold along the path, and
what is sent is one force followed by braking, which the filter has made room for.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.control.fallback_policy import PlanSource
from mpc_cover.distributed.potential_functions import CoverageShape, coordination_of
from mpc_cover.distributed.potential_law import Bounds, LawParameters, PotentialLaw, random_signal
from mpc_cover.distributed.stall_escape import StallEscape
from mpc_cover.errors import UserError
from mpc_cover.information.build import make_map
from mpc_cover.model.braking import braking_trajectory, braking_velocities
from mpc_cover.model.constraint_tightening import tightened
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.studies.outcome import Step, stepped

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.information.demand import FlownMap
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.mission.load import Mission

_PATIENCE_S = 5.0
"""Time without a newly covered cell after which one cell counts only."""


class PotentialFleetLaw:
    """The law with the escape of lemma 6.2.1; deterministic for a seed.

    Parameters
    ----------
    mission : what to cover, with whom.
    seed : of the random signal (5.17).

    Raises
    ------
    UserError
        The law cannot keep this fleet apart.
    """

    def __init__(self, mission: Mission, seed: int) -> None:
        fleet = self._fleet = tightened(mission)
        self._period = mission.spec.control.period_s
        self._value, self._cell = mission.field.weight, mission.field.cell
        self.coverage: FlownMap = make_map(mission)
        self._rng = np.random.default_rng(seed)
        order = self._rng.permutation(mission.field.size)
        patience = max(2.0, _PATIENCE_S / self._period)
        self._able = fleet.speed_max
        self._escapes = [StallEscape(order, patience) for _ in fleet.ids]
        try:
            self._law = _law_of(fleet, mission.field.cell, self._period)
        except ValueError as error:
            raise UserError(f"--controllers potential: mission {mission.spec.name}: {error}") from None

    def prepare(self, position: FloatArray, velocity: FloatArray, start_time: float, *, deadline: float | None) -> Step:
        """Start: the law plans nothing."""
        return self.step(position, velocity, start_time, deadline=deadline)

    def step(self, position: FloatArray, velocity: FloatArray, start_time: float, *, deadline: float | None) -> Step:
        """Return the law's force for a period from the (m, d) state at `start_time`, then braking."""
        begun = time.perf_counter()
        if self.coverage.complete:
            stop = braking_trajectory(position, velocity, self._fleet, start_time, self._period, 1)
            return stepped(begun, deadline, stop, "all is covered", PlanSource.REST)
        kept = self._law.kept_edges(position, velocity)
        for one, two in self._fleet.links:
            kept[one, two] = kept[two, one] = True
        signal = random_signal(self._rng, *position.shape)
        wish = self._law.wish(position, self._weight(), kept, signal)
        after = velocity + self._period * self._law.force(position, velocity, wish, kept)
        later = np.concatenate([after[None], braking_velocities(after, self._fleet, self._period)])
        plan = Trajectory.from_velocities(position, velocity, later, start_time, self._period)
        return stepped(begun, deadline, plan, "down the potential")

    def limit_speed(self, index: int, part: float) -> None:
        """Ask agent number `index` for this part of its speed at most."""
        speed = self._fleet.speed_max.copy()
        speed[index] = part * self._able[index]
        self._fleet = replace(self._fleet, speed_max=speed)
        self._law = _law_of(self._fleet, self._cell, self._period)

    def _weight(self) -> FloatArray:
        """Return gamma (m, K): what each agent can measure and is owed, and one cell of it if that takes too long."""
        able = np.isfinite(self._fleet.radius).astype(float)
        weight = able @ (self.coverage.owed * self._value)
        return np.array([escape.attend(own) for escape, own in zip(self._escapes, weight, strict=True)])


def _law_of(fleet: Fleet, cell: FloatArray, period: float) -> PotentialLaw:
    """Return the law; cells attract from beyond a quarter of the smallest radius."""
    core = 0.25 * float(np.where(np.isfinite(fleet.radius), fleet.radius, np.inf).min())
    bounds = Bounds(fleet.speed_max, fleet.input_max, fleet.motion_min, fleet.motion_max)
    return PotentialLaw(cell, bounds, coordination_of(fleet), LawParameters(CoverageShape(core_m=core)), period)
