"""How fast agents really are: a slow one does not know it, but shows it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.disturbance import disturbs_motion
from mpc_cover.model.tube import tube_of

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.fleet_view import AgentLink

SHORT = 0.03
"""Part of its limit by which an agent's speed must fall short of its reference's, beyond the tube's."""
STEADY = 0.02
"""Part of its limit by which the speeds of two reports may differ at a speed that is held."""
KEPT = 0.97
"""Part of the speed that was seen which plans may ask for: the rest is for catching up."""
SLOWEST = 0.05
"""Nobody is thought slower than this part of its limit."""


class Pace:
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
        if not self._disturbed or link.state is None or link.before is None:
            return False
        limit = float(self._speed_max[index])
        earlier, now = (float(np.linalg.norm(state.velocity)) for state in (link.before, link.state))
        reference = link.state.reference_velocity, link.before.reference_velocity
        asked = min(float(np.linalg.norm(velocity)) if velocity else 0.0 for velocity in reference)
        behind = np.dot(np.subtract(link.planned()[0], link.measured()[0]), link.planned()[1]) > 0.0
        held = abs(now - earlier) <= STEADY * limit
        if not behind or not held or asked - max(now, earlier) <= self._tube_speed + SHORT * limit:
            return False
        part = max(SLOWEST, KEPT * max(now, earlier) / limit)
        slower = part < float(self.part[index])
        self.part[index] = min(part, float(self.part[index]))
        return slower

    def speed_max(self, index: int) -> float:
        """Return what agent number `index` can reach [m/s], inf as long as it has not shown otherwise."""
        part = float(self.part[index])
        return part / KEPT * float(self._speed_max[index]) if part < 1.0 else np.inf

    def forget(self, index: int) -> None:
        """Think of agent number `index` as of a new one."""
        self.part[index] = 1.0
