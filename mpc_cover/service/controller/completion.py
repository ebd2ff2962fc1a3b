"""Completion of a mission: everything that can be covered is covered, or its time is up."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from mpc_cover.service.protocol.messages import Phase

if TYPE_CHECKING:
    from mpc_cover.information.demand import FlownMap
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.controller.fleet_supervisor import FleetSupervisor
    from mpc_cover.service.controller.mission_clock import MissionClock


class Completion:
    """Determines when one version of a mission is over, and how.

    Parameters
    ----------
    mission, coverage : what is to be covered, and what has been.
    supervisor, mission_clock : which agents can still cover it, and the mission time.
    """

    def __init__(
        self, mission: Mission, coverage: FlownMap, supervisor: FleetSupervisor, mission_clock: MissionClock
    ) -> None:
        self._cells, self._limit_s = mission.field.size, mission.spec.control.time_limit_s
        self._coverage, self._supervisor, self._mission_clock = coverage, supervisor, mission_clock
        self._nothing_left_s = math.inf

    @property
    def nothing_left(self) -> bool:
        """Whether everything is measured that the agents that are not lost can measure."""
        nothing = self._coverage.complete or not (self._coverage.owed & self._supervisor.reachable).any()
        if not nothing:  # anew, where a lost agent has come back
            self._nothing_left_s = math.inf
        return bool(nothing)

    def since_s(self, now_s: float) -> float:
        """Return the time since nothing is left, by the controller's clock [s]; to be called only then."""
        self._nothing_left_s = min(self._nothing_left_s, now_s)
        return now_s - self._nothing_left_s

    def out_of_time(self) -> tuple[Phase, str] | None:
        """Return the phase and message of an end because time is up; None while there is time or nothing is left."""
        if self.nothing_left or self._mission_clock.now() <= self._limit_s:
            return None
        if self._coverage.endless:
            return Phase.COMPLETE, f"the patrol ends after control.time_limit_s {self._limit_s:g} s"
        return Phase.FAILED, f"{self._left} after control.time_limit_s {self._limit_s:g} s"

    def ending(self) -> tuple[Phase, str]:
        """Return the phase and message of an end because nothing is left and all agents are at rest."""
        lost = ", ".join(self._supervisor.lost)
        if not self._coverage.complete:
            without = f"{self._left}, and cannot be without {lost}"
            return Phase.FAILED, f"{without}: all else is, and everyone is at rest"
        rest = f", and everyone but {lost}" if lost else " and everyone"
        return Phase.COMPLETE, f"everything is covered{rest} is at rest"

    @property
    def _left(self) -> str:
        """How many cells are not covered, by the agents' reports; which may lag behind what they have flown."""
        return f"{self._cells - self._coverage.covered_count} of {self._cells} cells are not reported as covered"
