"""Estimates the speeds that agents reach, from their reports: a slow agent does not know that it is slow."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.disturbance import disturbs_motion
from mpc_cover.model.tube import tube_of

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.controller.fleet_monitor import AgentLink
    from mpc_cover.service.protocol.messages import State

SHORT = 0.03
"""Part of its limit by which an agent's speed must fall short of its reference's, beyond the tube's."""
STEADY = 0.02
"""Part of its limit by which the speeds of two reports may differ at a constant speed."""
KEPT = 0.97
"""Part of the estimated speed that plans may ask for: the rest is for catching up."""
SLOWEST = 0.05
"""Smallest estimate, as a part of the limit."""


class SpeedEstimator:
    """Estimates the share of its speed limit that each agent reaches.

    An agent at its true limit lags behind its reference at a constant speed, while the reference is faster: seen in
    two reports in a row, that speed is its true limit.

    Attributes
    ----------
    share : (m,) of the speed limit that plans may ask for, 1 at first.
    """

    def __init__(self, mission: Mission) -> None:
        self.share: FloatArray = np.ones(mission.fleet.size)
        self._speed_max = mission.fleet.speed_max
        self._disturbed = disturbs_motion(mission.spec.disturbance)
        self._tube_speed = tube_of(mission).velocity_m_per_s if self._disturbed else 0.0

    def update(self, index: int, link: AgentLink) -> bool:
        """Update by the newest two reports of agent number `index`; return whether it is slower than estimated."""
        if link.state is None or link.previous is None:
            return False
        limit = float(self._speed_max[index])
        now, earlier = _speed(link.state), _speed(link.previous)
        steady = abs(now - earlier) <= STEADY * limit
        if not steady or not self._lags(index, link.state) or not self._lags(index, link.previous):
            return False
        share = max(SLOWEST, KEPT * max(now, earlier) / limit)
        slower = share < float(self.share[index])
        self.share[index] = min(share, float(self.share[index]))
        return slower

    def speed_max(self, index: int, link: AgentLink) -> float:
        """Return the speed that agent number `index` reaches by its reports so far [m/s]; inf when unknown.

        An agent that lags is not expected to speed up, even before it is certain that it cannot.
        """
        share = float(self.share[index])
        if share < 1.0:
            return share / KEPT * float(self._speed_max[index])
        return _speed(link.state) if link.state is not None and self._lags(index, link.state) else np.inf

    def reset(self, index: int) -> None:
        """Discard the estimate for agent number `index`."""
        self.share[index] = 1.0

    def _lags(self, index: int, state: State) -> bool:
        """Return whether an agent is behind a reference that is faster."""
        if not self._disturbed or state.reference_position is None or state.reference_velocity is None:
            return False
        asked = float(np.linalg.norm(state.reference_velocity))
        short = asked - _speed(state) > self._tube_speed + SHORT * float(self._speed_max[index])
        behind = np.dot(np.subtract(state.reference_position, state.position), state.reference_velocity)
        return short and float(behind) > 0.0


def _speed(state: State) -> float:
    return float(np.linalg.norm(state.velocity))
