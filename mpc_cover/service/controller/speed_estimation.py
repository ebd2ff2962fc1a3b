"""How fast agents really are: a slow one does not know it, but shows it."""

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
"""Part of its limit by which the speeds of two reports may differ at a speed that is held."""
KEPT = 0.97
"""Part of the speed that was seen which plans may ask for: the rest is for catching up."""
SLOWEST = 0.05
"""Nobody is thought slower than this part of its limit."""


class SpeedEstimator:
    """Which part of its speed limit each agent reaches, as far as it has shown: `part` (m,), 1 at first.

    An agent at the end of its powers lags behind its reference at a speed that it holds, while the reference is
    faster: seen in two reports in a row, that speed is what it can do.
    """

    def __init__(self, mission: Mission) -> None:
        self.part: FloatArray = np.ones(mission.fleet.size)
        self._speed_max = mission.fleet.speed_max
        self._disturbed = disturbs_motion(mission.spec.disturbance)
        self._tube_speed = tube_of(mission).velocity_m_per_s if self._disturbed else 0.0

    def learn(self, index: int, link: AgentLink) -> bool:
        """Look at the newest two reports of agent number `index`; return whether it is slower than thought."""
        if link.state is None or link.before is None:
            return False
        limit = float(self._speed_max[index])
        now, earlier = _speed(link.state), _speed(link.before)
        held = abs(now - earlier) <= STEADY * limit
        if not held or not self._lags(index, link.state) or not self._lags(index, link.before):
            return False
        part = max(SLOWEST, KEPT * max(now, earlier) / limit)
        slower = part < float(self.part[index])
        self.part[index] = min(part, float(self.part[index]))
        return slower

    def speed_max(self, index: int, link: AgentLink) -> float:
        """Return what agent number `index` can reach [m/s] by all that it has shown; inf when that is nothing.

        Whoever lags is not expected to speed up, even before it is certain that it cannot.
        """
        part = float(self.part[index])
        if part < 1.0:
            return part / KEPT * float(self._speed_max[index])
        return _speed(link.state) if link.state is not None and self._lags(index, link.state) else np.inf

    def forget(self, index: int) -> None:
        """Think of agent number `index` as of a new one."""
        self.part[index] = 1.0

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
