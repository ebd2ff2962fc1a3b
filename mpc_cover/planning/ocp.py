"""The optimal control problem (OCP) of coverage over a fixed horizon, and the margins of its constraints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.graph import bottleneck, fleet_trees
from mpc_cover.constraints.pairs import distances_at
from mpc_cover.model.look_instants import InterSample
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
    """Margins of plans on each constraint, for solver tolerances and imperfect clocks; plain choices.

    Attributes
    ----------
    separation, connectivity : [m], off rho_B and rho_C.
    limits : part of u_max and v_max.
    solver : further part of u_max and v_max in the QP, which is solved to a finite tolerance.
    """

    separation: float = 0.01
    connectivity: float = 0.01
    limits: float = 5e-4
    solver: float = 1e-3

    @property
    def limit_share(self) -> float:
        """The part of u_max and v_max that the QP may use."""
        return 1.0 - self.limits - self.solver


@dataclass(frozen=True, eq=False)
class OCP:
    """An optimal control problem: cover weighted cells within N steps, subject to constraints and boundary conditions.

    Attributes
    ----------
    fleet : limits, sensing radii, ranges.
    cell : (K, d) [m].
    weight : (J, K) gamma of the outstanding demand, 0 where there is none.
    steps : N.
    period : T_s [s].
    ends : boundary conditions at samples 0 and N, (m, d) [m], [m/s].
    looks : (J, K) outstanding looks; None for one each.
    on_iterate : called with each decision vector that the SQP accepts, in any search; an exception ends the search.
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
        """Return the decision vector of a motion of N steps, with the boundary conditions satisfied exactly."""
        return self.exact_ends(self.decision(motion.position[0], motion.velocity))

    def motion(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions [m] and velocities [m/s], (N+1, m, d), of a decision vector; the dynamics hold exactly."""
        shape = self.fleet.start.shape
        start = x[: self.fleet.start.size].reshape(shape)
        velocity = x[self.fleet.start.size :].reshape(self.steps + 1, *shape)
        position, _ = roll_out(start, velocity[0], np.diff(velocity, axis=0) / self.period, self.period)
        return position, velocity

    def between(self, velocity: FloatArray) -> InterSample | None:
        """Return what counts between the samples of a motion with velocities (N+1, m, d) [m/s]; None if none."""
        instants = self.fleet.look_instants
        return None if instants.only_samples or self.looks is not None else InterSample(velocity, self.period, instants)

    def exact_ends(self, x: FloatArray) -> FloatArray:
        """Return `x` with exact boundary conditions: the QP's residual is distributed over the velocities."""
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
    """How the subproblem approximates the NLP; values are plain choices unless stated otherwise."""

    softness: Softness
    margins: Margins = Margins()
    sides: int = 8
    """Sides of the polygons inside the discs of speed and input."""
    edge_sides: int = 16
    """Sides of the polygons inside the discs of communication range."""
    penalty: float = 50.0
    """Weight of the l1 penalty, per metre of violated separation, connectivity or passive safety, in cells."""
    proximal: float = 1e-4
    """Weight of the squared distance to the iterate, which makes the QP strictly convex."""
    stop_reach: float = 0.25
    """Passive safety gets rows only where a violation is nearer than this [m]; the next iterate has rows of its own."""
    exact_cones: bool = False
    """Speeds, inputs and edges as second-order cones instead of polytopes, for back-ends that have them."""


@dataclass(frozen=True, eq=False)
class Requirements:
    """Required distances of an OCP's plans.

    Attributes
    ----------
    separation : (pairs,) least distance [m]: rho_B plus the margin, or what a given state leaves of the margin.
    range : longest edge [m]: rho_C minus the margin, or what a given state requires of the margin.
    """

    separation: FloatArray
    range: float


def requirements(ocp: OCP, margins: Margins) -> Requirements:
    """Return the requirements, with margins (never constraints) relaxed to what given end states allow."""
    fleet, reach = ocp.fleet, ocp.fleet.communication_range
    least = fleet.separations
    separation = least + margins.separation
    allowed = reach - margins.connectivity
    for given in (ocp.ends.start_position, ocp.ends.end_position):
        if given is None:
            continue
        here = distances_at(given)[None]
        separation = np.maximum(least, np.minimum(separation, here[0]))
        allowed = min(reach, max(allowed, float(bottleneck(here, fleet_trees(here, fleet))[0])))
    return Requirements(separation, allowed)
