"""How the agents of the distributed law agree on a start time without a coordinator.

Every agent announces repeatedly that it is present and which others it knows of, to those in range. The mission's first
agent chooses a start time as soon as it knows of all, far enough ahead for the announcement to reach every agent, and
all pass it on. All share one clock, as processes on one machine do.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.decoding import RejectedError
from mpc_cover.service.protocol.fingerprint import mission_hash
from mpc_cover.service.protocol.keys import Keys, agent_of
from mpc_cover.service.protocol.messages import encode
from mpc_cover.service.swarm.radio_messages import Hello

if TYPE_CHECKING:
    from mpc_cover.clock import Clock
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.protocol.bus import Transport
    from mpc_cover.service.protocol.events import EventLog
    from mpc_cover.service.swarm.radio_messages import Codec

ANNOUNCE_EVERY_S = 0.1
"""Period of the announcements [s of the machine's clock]."""
NOTICE_S = 0.5
"""How long before the start the last agent should learn of it, besides the transmission time [s of the same]."""
CLOCK_SKEW_MAX_S = 2.0
"""Clocks that differ by more than this, transmission included, are not one clock [s of the same]."""
_DEPTH = 1024
HELLO = bus.Quality("INTERACTIVE_HIGH")


class StartAgreement:
    """One agent's part in the agreement; `start_s` is the time agreed on by the clock, or None.

    Parameters
    ----------
    identity : agent id and instance.
    seed, speed : the fleet's; agents that announce others are ignored.
    """

    def __init__(
        self,
        mission: Mission,
        identity: tuple[str, str],
        transport: Transport,
        clock: Clock,
        codec: Codec,
        *,
        seed: int,
        speed: float,
        events: EventLog,
    ) -> None:
        self._id, self._instance = identity
        self._index = mission.fleet.ids.index(self._id)
        self._mission, self._fleet = mission_hash(mission), mission.fleet
        self._clock, self._codec, self._events = clock, codec, events
        self._seed, self._speed = seed, speed
        keys = Keys(mission.spec.name)
        self._publisher = transport.publisher(keys.hello(self._id), HELLO)
        self._inbox = transport.inbox(keys.hello(), _DEPTH)
        self._present = {self._id}
        self._due_s = clock.now()
        self._period_s = mission.spec.control.period_s
        self.start_s: float | None = None

    @property
    def next_time(self) -> float:
        """When the next announcement is due [s]."""
        return self._due_s

    def tick(self) -> None:
        """Take in the announcements of others, and announce which agents are present and the start time if known."""
        now = self._clock.now()
        for item in self._inbox.drain():
            try:
                hello = self._codec.hello(item.payload)
            except RejectedError as error:
                self._events.emit(error.reason.name.lower(), f"ignores {agent_of(item.key)}: {error}")
                continue
            if hello.agent != self._id or hello.instance != self._instance:
                self._receive(hello, now)
        for refused in self._inbox.take_refused():
            self._events.emit(refused.reason.name.lower(), f"ignores an announcement: {refused}")
        if self.start_s is None and self._index == 0 and len(self._present) == self._fleet.size:
            hops = 2.0 * ANNOUNCE_EVERY_S * self._fleet.size
            self.start_s = now + self._period_s + self._speed * (hops + NOTICE_S)
            self._events.emit("start", f"all {self._fleet.size} agents are there: names the start")
        self._announce(now)
        self._due_s = max(self._due_s + ANNOUNCE_EVERY_S * self._speed, now)

    def _receive(self, hello: Hello, now: float) -> None:
        """Accept the announcement of an agent in range that flies the same mission."""
        if hello.agent == self._id:
            self._events.emit("twice", f"another process says that it is {self._id}, too")
            return
        if (problem := self._problem(hello, now)) is not None:
            self._events.emit("misfit", f"ignores {hello.agent}: {problem}")
            return
        away = np.linalg.norm(np.array(hello.position) - self._fleet.start[self._index])
        if away > self._fleet.communication_range:
            return  # out of radio range
        self._present.update((hello.agent, *hello.present))
        if self.start_s is None and hello.start_s is not None:
            self.start_s = hello.start_s

    def _problem(self, hello: Hello, now: float) -> str | None:
        if hello.mission != self._mission:
            return "its mission is another one, although of the same name"
        if (hello.seed, hello.speed) != (self._seed, self._speed):
            return f"its --seed {hello.seed} and --speed {hello.speed:g} are not {self._seed} and {self._speed:g}"
        if abs(hello.time_s - now) > CLOCK_SKEW_MAX_S * self._speed:
            return "its clock is another one: agents that fly without a controller must share the machine's clock"
        return None

    def _announce(self, now: float) -> None:
        hello = Hello(
            agent=self._id,
            instance=self._instance,
            mission=self._mission,
            seed=self._seed,
            speed=self._speed,
            time_s=now,
            position=self._fleet.start[self._index].tolist(),
            present=tuple(sorted(self._present)),
            start_s=self.start_s,
        )
        self._publisher.publish(encode(hello))

    @property
    def text(self) -> str:
        """Which agents it waits for."""
        missing = [name for name in self._fleet.ids if name not in self._present]
        return f"waits for {', '.join(missing)}" if missing else "waits for the start"
