"""The thesis's potential law as a brain of the service: the same plant, the same map, a step at a time.

The law is distributed; here one place runs it for the whole fleet on the fleet's map, which spares it the delays
of a network. Its forces pass the stopping filter, so that separation and connectivity hold along the path, and
what is sent is one force followed by braking, which the filter has made room for.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.control.escape import Escape
from mpc_cover.control.fallback import Rung, brake, plan_from_velocities
from mpc_cover.control.potential import Coordination, CoverageShape
from mpc_cover.control.potential_law import Bounds, LawParameters, PotentialLaw, random_signal
from mpc_cover.errors import UserError
from mpc_cover.information.coverage_map import CoverageMap
from mpc_cover.studies.outcome import Step, stepped, stopping_plan

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.mission.load import Mission

_PATIENCE_S = 5.0
"""Time without a newly covered cell after which one cell counts only."""


class PotentialBrain:
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
        fleet, self._period = mission.fleet, mission.spec.control.period_s
        self._mission = mission
        self.coverage = CoverageMap(mission)
        self._rng = np.random.default_rng(seed)
        order = self._rng.permutation(mission.field.size)
        patience = max(2.0, _PATIENCE_S / self._period)
        self._escapes = [Escape(order, patience) for _ in fleet.ids]
        core = 0.25 * float(np.where(np.isfinite(fleet.radius), fleet.radius, np.inf).min())
        bounds = Bounds(fleet.speed_max, fleet.input_max, fleet.motion_min, fleet.motion_max)
        parameters = LawParameters(CoverageShape(core_m=core))
        try:
            self._law = PotentialLaw(mission.field.cell, bounds, _coordination(fleet), parameters, self._period)
        except ValueError as error:
            raise UserError(f"--controllers potential: mission {mission.spec.name}: {error}") from None

    def prepare(self, position: FloatArray, velocity: FloatArray, start_time: float, *, deadline: float | None) -> Step:
        """Start: the law plans nothing."""
        return self.step(position, velocity, start_time, deadline=deadline)

    def step(self, position: FloatArray, velocity: FloatArray, start_time: float, *, deadline: float | None) -> Step:
        """Return the law's force for a period from the (m, d) state at `start_time`, then braking."""
        begun = time.perf_counter()
        if self.coverage.complete:
            stop = stopping_plan(self._mission, position, velocity, start_time, 1)
            return stepped(begun, deadline, stop, "all is covered", Rung.REST)
        kept = self._law.kept_edges(position, velocity)
        for one, two in self._mission.fleet.links:
            kept[one, two] = kept[two, one] = True
        signal = random_signal(self._rng, *position.shape)
        wish = self._law.wish(position, self._weight(), kept, signal)
        after = velocity + self._period * self._law.force(position, velocity, wish, kept)
        later = np.concatenate([after[None], brake(after, self._mission.fleet, self._period)])
        plan = plan_from_velocities(position, velocity, later, start_time, self._period)
        return stepped(begun, deadline, plan, "down the potential")

    def _weight(self) -> FloatArray:
        """Return gamma (m, K): what each agent can measure and is owed, and one cell of it if that takes too long."""
        able = np.isfinite(self._mission.fleet.radius).astype(float)
        weight = able @ (self.coverage.owed * self._mission.field.weight)
        return np.array([escape.attend(own) for escape, own in zip(self._escapes, weight, strict=True)])


def _coordination(fleet: Fleet) -> Coordination:
    """Return the bounds, with potentials (6.1, 6.5) that begin at twice rho_B and at 0.8 rho_C."""
    least, reach = fleet.separation_min, fleet.communication_range
    return Coordination(
        separation_m=least,
        repel_within_m=min(2.0 * least, reach),
        range_m=reach,
        attract_beyond_m=0.8 * reach if np.isfinite(reach) else np.inf,
    )
