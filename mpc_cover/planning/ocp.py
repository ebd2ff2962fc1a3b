"""A stretch of motion to be planned: what is given, and what plans keep to spare."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.graph import bottleneck, fleet_trees
from mpc_cover.constraints.pairs import pair_distances
from mpc_cover.model.motion import roll_out

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.constraints.boundary import BoundaryConditions
    from mpc_cover.coverage.majoriser import Softness
    from mpc_cover.model.fleet_constraints import FleetConstraints
    from mpc_cover.model.trajectory import Trajectory


@dataclass(frozen=True)
class Margins:
    """What plans keep to spare of each constraint, so that tolerances and clocks cannot eat into it.

    Attributes
    ----------
    separation, connectivity : [m], off rho_B and rho_C.
    limits : part of u_max and v_max.
    solver : further part of u_max and v_max inside the QP, which is solved inexactly.
    """

    separation: float = 0.01
    connectivity: float = 0.01
    limits: float = 5e-4
    solver: float = 1e-3

    @property
    def limit_share(self) -> float:
        """The part of u_max and v_max that a QP may use."""
        return 1.0 - self.limits - self.solver


@dataclass(frozen=True, eq=False)
class OCP:
    """A stretch of motion to be planned, and what is asked of its ends.

    Attributes
    ----------
    fleet : limits, radii, ranges.
    cell : (K, d) [m].
    weight : (J, K) gamma, what is still owed.
    steps : N.
    period : T_s [s].
    ends : states at sample 0 and N that are given, (m, d) [m], [m/s].
    looks : (J, K) looks owed; None for one each.
    on_iterate : told each decision vector that the SQP accepts, in whatever search; what it raises ends the search.
    """

    fleet: FleetConstraints
    cell: FloatArray
    weight: FloatArray
    steps: int
    period: float
    ends: BoundaryConditions
    looks: IntArray | None = None
    on_iterate: Callable[[FloatArray], None] | None = None

    @property
    def first(self) -> int:
        """The first sample that is not given: 1, or 0 when the start is free."""
        return 0 if self.ends.start_position is None else 1

    def decision(self, position: FloatArray, velocity: FloatArray) -> FloatArray:
        """Return the decision vector: the (m, d) `position` at sample 0 and the (N+1, m, d) velocities, flat."""
        return np.concatenate([position.ravel(), velocity.ravel()])

    def decision_of(self, motion: Trajectory) -> FloatArray:
        """Return the decision vector of a motion of as many steps, with the ends exactly as asked."""
        return self.exact_ends(self.decision(motion.position[0], motion.velocity))

    def motion(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions [m] and velocities [m/s], (N+1, m, d), of a decision vector: dynamics hold exactly."""
        shape = self.fleet.start.shape
        start = x[: self.fleet.start.size].reshape(shape)
        velocity = x[self.fleet.start.size :].reshape(self.steps + 1, *shape)
        position, _ = roll_out(start, velocity[0], np.diff(velocity, axis=0) / self.period, self.period)
        return position, velocity

    def exact_ends(self, x: FloatArray) -> FloatArray:
        """Return `x` with the ends exactly as asked: what a QP's tolerance leaves is spread over the velocities."""
        ends, size = self.ends, self.fleet.start.size
        start = x[:size].reshape(self.fleet.start.shape) if ends.start_position is None else ends.start_position
        velocity = x[size:].reshape(self.steps + 1, *self.fleet.start.shape).copy()
        velocity[:, self.fleet.lost] = 0.0
        if ends.start_velocity is not None:
            velocity[0] = ends.start_velocity
        if ends.closed:
            velocity[-1] = velocity[0]
        elif ends.end_velocity is not None:
            velocity[-1] = ends.end_velocity
        target = start if ends.closed else ends.end_position
        if target is not None and self.steps > 1:
            position, _ = self.motion(self.decision(start, velocity))
            moving = list(self.fleet.active)
            velocity[1:-1, moving] += (target - position[-1])[moving] / (self.period * (self.steps - 1))
        return self.decision(start, velocity)


@dataclass(frozen=True)
class Settings:
    """How the subproblem approximates the NLP."""

    softness: Softness
    margins: Margins = Margins()
    sides: int = 8
    edge_sides: int = 16
    penalty: float = 50.0
    """Cost of a metre of violated separation or connectivity, in cells times metres."""
    proximal: float = 1e-4
    """Weight of the distance to the iterate, which makes the QP strictly convex."""
    stop_reach: float = 0.25
    """Room to stop is looked after where less than this is to spare [m]: the rest is left to the next iterate."""
    exact_cones: bool = False
    """Speeds, inputs and edges as second-order cones instead of polytopes, for back-ends that have them."""


@dataclass(frozen=True, eq=False)
class Requirements:
    """Distances that a window's plans must keep.

    Attributes
    ----------
    separation : (pairs,) least distance [m]: rho_B and the margin, or what the start leaves of the margin.
    range : greatest edge [m]: rho_C less the margin, or what the start needs of the margin.
    """

    separation: FloatArray
    range: float


def requirements(ocp: OCP, margins: Margins) -> Requirements:
    """Relax the margins, never the constraints themselves, to what the window's given ends allow."""
    fleet, reach = ocp.fleet, ocp.fleet.communication_range
    least = fleet.separations
    separation = least + margins.separation
    allowed = reach - margins.connectivity
    for given in (ocp.ends.start_position, ocp.ends.end_position):
        if given is None:
            continue
        still = np.repeat(given[None], 2, axis=0)
        here = pair_distances(still, np.zeros_like(still), ocp.period).sampled[:1]
        separation = np.maximum(least, np.minimum(separation, here[0]))
        allowed = min(reach, max(allowed, float(bottleneck(here, fleet_trees(here, fleet))[0])))
    return Requirements(separation, allowed)
