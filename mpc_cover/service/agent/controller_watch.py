"""What an agent hears of controllers: whether its id is taken, how the mission ended, which missions there are."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpc_cover.service.protocol.decoding import RejectedError, decode_status
from mpc_cover.service.protocol.keys import ANY, Keys, mission_of
from mpc_cover.service.protocol.messages import Phase

if TYPE_CHECKING:
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.protocol.bus import Transport
    from mpc_cover.service.protocol.events import EventLog
    from mpc_cover.service.protocol.messages import Status

DEPTH = 8
"""Statuses kept between two ticks; a controller sends one twice a second."""
TAKEN_AFTER_S = 2.0
"""An id is another process's if controllers say so for so long [s of the machine's clock]: longer than the token of a
process that has died may stay, which is a second."""
ALONE_AFTER_S = 2.0
"""After so long without a controller of its mission an agent says which others there are [s of the machine's clock]."""
_ENDED = {Phase.COMPLETE, Phase.FAILED, Phase.STOPPED}


class ControllerWatch:
    """Follows the statuses and the presence of controllers, and tells of them in events.

    Attributes
    ----------
    taken_by : the instance of the process that is this agent for the controller, if it is another one; else empty.
    """

    def __init__(
        self, mission: Mission, agent_id: str, instance: str, transport: Transport, events: EventLog, *, speed: float
    ) -> None:
        self.taken_by = ""
        self._id, self._instance, self._events, self._speed = agent_id, instance, events, speed
        self._mission = mission.spec.name
        self._statuses = transport.inbox(Keys(self._mission).status, DEPTH, history=1)
        self._presence = transport.presence(Keys(ANY).controller_instance())
        self._taken_since: float | None = None
        self._alone_since: float | None = None
        self._told_others: frozenset[str] = frozenset()
        self._told: tuple[str, Phase] | None = None
        self._controller = ""
        self._signed = transport.signed
        self._newest: tuple[int, str, int] = -1, "", -1

    @property
    def controller(self) -> str:
        """The controller process that was heard last; empty before the first."""
        return self._controller

    def tick(self, now_s: float) -> None:
        """Take in what was heard by `now_s` of the agent's clock [s]."""
        for item in self._statuses.drain():
            try:
                status = decode_status(item.payload)
            except RejectedError:
                continue
            if self._signed and not self._is_news(status):
                continue  # sent again by somebody who could not have made it
            self._check_id(status, now_s)
            self._follow(status)
        self._look_around(now_s)

    def _is_news(self, status: Status) -> bool:
        """Return whether a status is newer than all that were heard."""
        epoch, controller, seq = self._newest
        if status.epoch < epoch or ((status.epoch, status.controller) == (epoch, controller) and status.seq <= seq):
            return False
        self._newest = status.epoch, status.controller, status.seq
        return True

    def _check_id(self, status: Status, now_s: float) -> None:
        known = status.instances.get(self._id, self._instance)
        if known == self._instance:
            self._taken_since = None
            return
        self._taken_since = now_s if self._taken_since is None else self._taken_since
        if now_s - self._taken_since >= TAKEN_AFTER_S * self._speed:
            self.taken_by = known

    def _follow(self, status: Status) -> None:
        """Tell how a mission ended, once."""
        self._controller = status.controller
        now = status.controller, status.phase
        if status.phase in _ENDED and self._told != now:
            self._events.emit(f"mission-{status.phase}", f"the mission is {status.phase}: {status.text}")
        self._told = now

    def _look_around(self, now_s: float) -> None:
        """Tell when the controller has gone without a word, and when there are only those of other missions."""
        alive = self._presence.alive()
        missions = {mission_of(key): key for key in alive}
        if self._mission in missions:
            self._alone_since = None
            return
        if self._alone_since is None:
            self._alone_since = now_s
            if self._told is not None and self._told[1] not in _ENDED:
                text = f"controller {self._controller[:8]} is not here any more: flies its plan to the end, and waits"
                self._events.emit("controller-gone", text)
        others = frozenset(missions)
        if others and others != self._told_others and now_s - self._alone_since >= ALONE_AFTER_S * self._speed:
            self._told_others = others
            names = ", ".join(sorted(others))
            text = f"the controller here is of mission {names}, not of {self._mission}: no plans will come from it"
            self._events.emit("other-mission", text)
