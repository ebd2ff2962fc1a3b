"""The measurement update: the agents' reported positions go into the map, and snapshots of it to a later controller."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.service.controller.fleet_monitor import FleetMonitor
from mpc_cover.service.controller.snapshot import Snapshot
from mpc_cover.service.protocol import bus

if TYPE_CHECKING:
    from mpc_cover.information.demand import FlownMap
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.controller.mission_clock import MissionClock
    from mpc_cover.service.protocol.bus import Transport


class MeasurementUpdate:
    """Updates the map from measured positions, in mission time.

    With `resume`, it continues that of an earlier controller: its map, what the agents have measured since (they keep
    a history), and its mission time, by the clock of an agent that both controllers know.

    Attributes
    ----------
    monitor : the agents' reports.
    """

    def __init__(
        self,
        mission: Mission,
        transport: Transport,
        coverage: FlownMap,
        mission_clock: MissionClock,
        *,
        speed: float,
        resume: Snapshot | None,
    ) -> None:
        self.monitor = FleetMonitor(mission, transport, speed, history=bus.STATE.history if resume else 0)
        self._coverage, self._mission_clock = coverage, mission_clock
        self._origins: dict[str, float] = {}
        if resume is not None:
            coverage.restore(resume.map)
            self._origins = dict(resume.origins)
            self.monitor.skip_measured(resume.heard)

    def set_mission(self, mission: Mission, coverage: FlownMap) -> None:
        """Update another map from now on, of another version of the mission for the same fleet."""
        self._coverage = coverage
        self.monitor.set_mission(mission)

    def update(self) -> None:
        """Take in the states that arrived, and update the map with what was measured."""
        rounds = self.monitor.receive()
        self._resume_clock()
        for measured_s, position in rounds:
            mission_s = [self._mission_clock.at(time_s) if np.isfinite(time_s) else -np.inf for time_s in measured_s]
            self._coverage.observe(np.array(mission_s), position)

    def snapshot(self, lost: dict[str, list[float]], *, finished: bool) -> Snapshot:
        """Return the progress of the mission; `lost` is where lost agents rest, (d,) [m], by id."""
        heard = {link.state.instance: link.state.seq for link in self.monitor.links if link.state}
        origins = self._agent_origins()
        now_s, versions = self._mission_clock.now(), self.monitor.earlier_versions
        return Snapshot(now_s, self._coverage.state(), finished, origins, lost, heard, versions)

    def _resume_clock(self) -> None:
        """Let mission time continue as under the earlier controller, once an agent that it knew has reported."""
        for link in self.monitor.links if self._origins else ():
            if link.state and link.state.instance in self._origins:
                self._mission_clock.resume(self._origins[link.state.instance] + link.offset)
                self._origins = {}
                return

    def _agent_origins(self) -> dict[str, float]:
        if not self._mission_clock.running:
            return self._origins
        origin_s = self._mission_clock.origin_s
        return {link.state.instance: origin_s - link.offset for link in self.monitor.links if link.state}
