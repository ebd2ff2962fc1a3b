"""The velocity that one agent wants: the potential law on its own map, around stalls and around silent agents."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.distributed.potential_law import random_signal
from mpc_cover.distributed.stall_escape import StallEscape, detour

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.distributed.parameters import AgentParameters
    from mpc_cover.distributed.potential_functions import Coordination
    from mpc_cover.distributed.potential_law import PotentialLaw
    from mpc_cover.distributed.state_report import StateReport
    from mpc_cover.mission.field import Field
    from mpc_cover.mission.fleet import Fleet


class DesiredVelocity:
    """Computes the velocity that one agent wants; the safety filters then limit it to what is safe.

    Parameters
    ----------
    fleet, field : the mission's.
    index : which agent of the fleet this is.
    coordination : rho_B, R_B, rho_C, R_C.
    parameters : how to run.
    order : (K,) the fleet's common order of escapes.
    rng : of this agent's random signal.
    """

    def __init__(
        self,
        fleet: Fleet,
        field: Field,
        index: int,
        *,
        coordination: Coordination,
        parameters: AgentParameters,
        order: IntArray,
        rng: np.random.Generator,
    ) -> None:
        self._fleet, self._field, self._index = fleet, field, index
        self._coordination, self._parameters, self._rng = coordination, parameters, rng
        self._able = (fleet.radius[index] > 0.0).astype(float)
        self._escape = StallEscape(order, parameters.patience)

    def towards_coverage(
        self, law: PotentialLaw, residual: FloatArray, rows: IntArray, position: FloatArray, kept: BoolArray
    ) -> FloatArray:
        """Return the velocity (d,) [m/s] that the law asks for among the agents heard (5.17).

        Parameters
        ----------
        law : for these agents.
        residual : (J, K) gamma of the agent's own map.
        rows : (n,) the agents heard, this one included.
        position : (n, d) theirs [m].
        kept : (n, n) edges kept between them.
        """
        me = int(np.flatnonzero(rows == self._index)[0])
        weight = np.zeros((len(rows), self._field.size))
        weight[me] = self._escape.attend(self._field.weight * (self._able @ residual))
        signal = random_signal(self._rng, len(rows), self._fleet.dimension)
        return np.asarray(law.desired_velocity(position, weight, kept, signal)[me])

    def around_silent(self, velocity: FloatArray, own: StateReport, balls: tuple[FloatArray, FloatArray]) -> FloatArray:
        """Return the velocity (d,) [m/s] that leads a stalled agent around silent ones, in turns left and right.

        `balls` are the (n, d) centres and (n,) radii [m] of what silent agents occupy. They have no repulsive
        potential: the safe sets keep agents apart, and cells beside them may have to be measured.
        """
        centre, radius = balls
        if not self._escape.stalled or len(centre) == 0:
            return velocity
        begins = max(self._coordination.repel_within_m, self._coordination.separation_m)
        near = radius + begins + self._parameters.period_s * self._fleet.speed_max[self._index]
        turn = 1.0 if own.sample // self._parameters.patience % 2 == 0 else -1.0
        return detour(velocity, own.position, centre, near, turn)
