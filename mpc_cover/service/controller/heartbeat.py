"""The controller's heartbeat: status, coverage map and events, published at the end of a tick."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.trajectory import SNAP_S
from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.events import EventLog
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.protocol.messages import MapMessage, Phase, Status, encode

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.clock import Clock
    from mpc_cover.information.demand import FlownMap
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.controller.fleet_monitor import FleetMonitor
    from mpc_cover.service.controller.step_log import StepLog
    from mpc_cover.service.protocol.bus import Transport

MAP_REQUESTS = 16


class Heartbeat:
    """Publishes the status and, half as often, the map.

    At most every `period_s` [s] of the clock, but at once when the phase changes, or who is lost or stands still.

    Attributes
    ----------
    text : what the controller is doing, for users.
    status : the newest status.
    events : the controller's events.
    epoch : of the controller.
    """

    def __init__(
        self,
        mission: Mission,
        transport: Transport,
        clock: Clock,
        identity: str,
        *,
        epoch: int,
        period_s: float,
        say: Callable[[str], None] | None,
    ) -> None:
        keys = Keys(mission.spec.name)
        self.text = ""
        self.status: Status | None = None
        self._transport = transport
        self._clock, self._identity, self.epoch, self._period_s = clock, identity, epoch, period_s
        self._status = transport.publisher(keys.status, bus.STATUS)
        self._map = transport.publisher(keys.map, bus.MAP)
        self._map_requests = transport.requests(keys.map, MAP_REQUESTS)
        self.events = EventLog("controller", transport.publisher(keys.controller_event, bus.EVENT), clock, say)
        self._due_s = self._map_due_s = -np.inf
        self._seq = 0

    def publish(
        self,
        phase: Phase,
        mission_time_s: float,
        coverage: FlownMap,
        step_log: StepLog,
        monitor: FleetMonitor,
        lost: list[str],
    ) -> None:
        """Publish the status and the map where they are due, and answer requests for the map."""
        now = self._clock.now()
        last, standing = step_log.last, monitor.standing(now)
        status = Status(
            controller=self._identity,
            epoch=self.epoch,
            seq=self._seq,
            phase=phase,
            mission_time_s=mission_time_s,
            covered_count=coverage.covered_count,
            cell_count=coverage.cell_count,
            steps=step_log.count,
            step_ms=1e3 * last.computing_time_s if last else 0.0,
            plan_source=last.plan_source if last else "",
            reason=(last.reason if last else "")[:1000],
            deadline_misses=step_log.misses,
            skipped_ticks=step_log.skipped,
            rejected=monitor.rejected.total(),
            callback_errors=self._transport.callback_errors,
            present=monitor.present(),
            lost=lost,
            text=self.text[:1000],
            instances={link.id: link.state.instance for link in monitor.links if link.state},
            standing={name: place for name, (place, _) in standing.items()},
            still_in_s={name: left_s for name, (_, left_s) in standing.items() if left_s > 0.0},
        )
        changed = self.status is None or self.status.phase is not phase or self.status.lost != lost
        changed = changed or (self.status is not None and self.status.standing.keys() != status.standing.keys())
        self.status = status
        if changed or now >= self._due_s - SNAP_S:
            self._seq += 1
            self._due_s = now + self._period_s
            self._status.publish(encode(status))
        self._publish_map(now, mission_time_s, coverage)

    def _publish_map(self, now: float, mission_time_s: float, coverage: FlownMap) -> None:
        requests = self._map_requests.drain()
        if not requests and now < self._map_due_s - SNAP_S:
            return
        message = MapMessage(
            controller=self._identity,
            epoch=self.epoch,
            mission_time_s=mission_time_s,
            cell_count=coverage.cell_count,
            covered_count=coverage.covered_count,
            bits=np.packbits(coverage.settled).tobytes().hex(),
        )
        payload = encode(message)
        for request in requests:
            request.reply(payload)
        if now >= self._map_due_s - SNAP_S:
            self._map_due_s = now + 2.0 * self._period_s
            self._map.publish(payload)
