"""A stretch of motion to be planned: what is given, and what plans keep to spare."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.graph import bottleneck, minimum_spanning_trees
from mpc_cover.constraints.pairs import pair_distances
from mpc_cover.model.motion import roll_out

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.coverage.majoriser import Softness
    from mpc_cover.mission.fleet import Fleet


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


@dataclass(frozen=True, eq=False)
class Window:
    """What is given of a stretch of motion: the state it starts from and what its end must be.

    Attributes
    ----------
    fleet : limits, radii, ranges.
    cell : (K, d) [m].
    weight : (J, K) gamma, what is still owed.
    position, velocity : (m, d) state at sample 0 [m], [m/s].
    steps : N.
    period : T_s [s].
    end_position : (m, d) [m], or None when it is free.
    end_velocity : (m, d) [m/s]; zero for an end at rest.
    """

    fleet: Fleet
    cell: FloatArray
    weight: FloatArray
    position: FloatArray
    velocity: FloatArray
    steps: int
    period: float
    end_position: FloatArray | None
    end_velocity: FloatArray

    def motion(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions [m] and velocities [m/s], (N+1, m, d), from the velocities at samples 1 to N."""
        velocity = np.concatenate([self.velocity[None], x.reshape(self.steps, *self.velocity.shape)])
        position, _ = roll_out(self.position, self.velocity, np.diff(velocity, axis=0) / self.period, self.period)
        return position, velocity


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


def requirements(window: Window, margins: Margins) -> Requirements:
    """Relax the margins, never the constraints themselves, to what the window's start allows."""
    fleet = window.fleet
    still = np.repeat(window.position[None], 2, axis=0)
    here = pair_distances(still, np.zeros_like(still), window.period).sampled[:1]
    wanted = fleet.separation_min + margins.separation
    separation = np.maximum(fleet.separation_min, np.minimum(wanted, here[0]))
    longest = float(bottleneck(here, minimum_spanning_trees(here, fleet.size))[0])
    reach = fleet.communication_range
    return Requirements(separation, min(reach, max(reach - margins.connectivity, longest)))
