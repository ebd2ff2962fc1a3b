"""Monitors the agents: which are present, their reported states, and the offsets of their clocks."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.service.protocol.decoding import Reason, RejectedError, decode_state
from mpc_cover.service.protocol.fingerprint import mission_hash
from mpc_cover.service.protocol.keys import Keys, agent_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.protocol.bus import Received, Transport
    from mpc_cover.service.protocol.messages import State

STATE_DEPTH = 1024
"""States kept for each agent between two ticks."""
STALE_PERIODS = 3.0
"""A state older than this many state periods is stale: the agent is predicted along its plan."""
HELD_S = 1.0
"""An id belongs to the process that has it, while its token is alive and it was heard so recently [s of the machine's
clock]: as long as a hung process keeps its token."""
JUMP_M = 0.01
"""A position may differ by this much more from the last than the agent's speed limit allows [m]."""


def planned_state(state: State) -> tuple[FloatArray, FloatArray]:
    """Return the state by an agent's plans, (d,) [m], [m/s]: the reference that it tracks, else the measured state."""
    position, velocity = state.reference_position, state.reference_velocity
    if position is None or velocity is None:
        position, velocity = state.position, state.velocity
    return np.array(position), np.array(velocity)


@dataclass
class AgentLink:
    """The controller's link to one agent: its newest state, and the offset of its clock.

    The offset (controller's clock minus agent's) is the smallest of (received - sent) so far: that of the message
    that was delayed least, and no less than `delay_s`. It is frozen while a mission is flown, so that the plans'
    samples stay on one grid of the agent's clock. `previous` is the state before the newest.
    """

    id: str
    speed_max: float
    noise_m: float = 0.0
    delay_s: float = 0.0
    state: State | None = None
    previous: State | None = None
    _smallest: float = np.inf
    _frozen: float | None = None
    retired: set[str] = field(default_factory=set)
    _newest_seq: dict[str, int] = field(default_factory=dict)

    @property
    def offset(self) -> float:
        """Controller's clock minus agent's clock [s]."""
        return self._smallest if self._frozen is None else self._frozen

    def freeze_offset(self) -> None:
        """Keep the offset as it is."""
        self._frozen = self._smallest

    def accept(self, state: State, received_s: float) -> bool:
        """Take in a state; return whether it is the first of a new process of the agent.

        Raises
        ------
        RejectedError
            It is of a former process, old, repeated, or of a position that the agent cannot have reached.
        """
        restarted = self.state is None or state.instance != self.state.instance
        if restarted:
            if state.seq <= self._newest_seq.get(state.instance, -1):  # of a process that came back, or a replay of it
                raise RejectedError(Reason.OLD, f"state {state.seq} of {self.id}, instance {state.instance}")
            self._begin(state)
        else:
            self._check(state)
        self.previous, self.state = None if restarted else self.state, state
        self._newest_seq[state.instance] = state.seq
        self._smallest = min(self._smallest, received_s - state.time_s - self.delay_s)
        return restarted

    def measured_s(self) -> float:
        """When the newest state was measured, in the controller's clock [s]; -inf before the first."""
        return self.state.time_s + self.offset if self.state else -np.inf

    def silence_s(self, now_s: float) -> float:
        """Return for how long nothing was heard, beyond the delay of reports [s]; inf before the first."""
        return now_s - self.measured_s() - self.delay_s

    def planned(self) -> tuple[FloatArray, FloatArray]:
        """Return its state by its plans, (d,) [m], [m/s]: the reference that it tracks, else the measured state."""
        assert self.state is not None
        return planned_state(self.state)

    def measured(self) -> tuple[FloatArray, FloatArray]:
        """Return its measured state, (d,) [m], [m/s]."""
        assert self.state is not None
        return np.array(self.state.position), np.array(self.state.velocity)

    def _begin(self, state: State) -> None:
        if self.state:
            self.retired.add(self.state.instance)
        self.retired.discard(state.instance)
        self._smallest, self._frozen = np.inf, None

    def _check(self, state: State) -> None:
        last = self.state
        assert last is not None
        if state.seq <= last.seq or state.time_s < last.time_s:
            raise RejectedError(Reason.OLD, f"state {state.seq} of {self.id} after {last.seq}")
        jump = float(np.linalg.norm(np.subtract(state.position, last.position)))
        if jump > self.speed_max * (state.time_s - last.time_s) + JUMP_M + 2.0 * self.noise_m:
            raise RejectedError(Reason.IMPLAUSIBLE, f"{self.id} moved {jump:.3g} m in no time")


class FleetMonitor:
    """All agents of a mission, in the order of its arrays.

    `speed` is that of the controller's clock; `history` is how many past states of each agent to request.
    `earlier_versions` are the fingerprints of earlier versions of this mission for the same fleet: an agent may have
    any of them, as its own limits and box are valid for this one, too.

    Attributes
    ----------
    links : the link to each agent.
    rejected : states that were rejected, by reason.
    restarted : ids of the agents whose process was seen for the first time in the last `receive`.
    on_state : called with number and link of an agent after each accepted state.
    not_genuine : why states were turned away in the last `receive` before they were looked at.
    identity : the controller's: where messages are signed, an agent is ready only once it says that it has heard it.
    others : by id, the last other process of an agent that was turned away, as its id is taken.
    """

    def __init__(self, mission: Mission, transport: Transport, speed: float = 1.0, *, history: int = 0) -> None:
        fleet, keys = mission.fleet, Keys(mission.spec.name)
        given = mission.spec.disturbance
        self.links = [
            AgentLink(name, float(speed), given.position_noise_m, given.delay_s)
            for name, speed in zip(fleet.ids, fleet.speed_max, strict=True)
        ]
        self.rejected: Counter[Reason] = Counter()
        self.restarted: list[str] = []
        self.identity, self._signed = "", transport.signed
        self.not_genuine: list[RejectedError] = []
        self._known: dict[str, int] = {}
        self.others: dict[str, str] = {}
        self.on_state: Callable[[int, AgentLink], None] | None = None
        self._index = {name: index for index, name in enumerate(fleet.ids)}
        self._shape, self._input_max = fleet.start.shape, fleet.input_max
        self.speed, self._mission = speed, mission_hash(mission)
        self.earlier_versions: list[str] = []
        self._state_period = mission.spec.control.state_period_s
        self._keys = keys
        self._states = transport.inbox(keys.state(), STATE_DEPTH * fleet.size, history=history)
        self._presence = transport.presence(keys.agent_alive())

    def set_mission(self, mission: Mission) -> None:
        """Go on with another version of the mission for the same fleet, whose agents have the earlier version."""
        self.earlier_versions = [*dict.fromkeys([*self.earlier_versions, self._mission])]
        self._mission = mission_hash(mission)

    def on_earlier_versions(self) -> list[str]:
        """Return the ids of the agents that have an earlier version of the mission."""
        earlier = set(self.earlier_versions) - {self._mission}
        return [link.id for link in self.links if link.state and link.state.mission in earlier]

    def skip_measured(self, heard: dict[str, int]) -> None:
        """Return no measurements from states up to these numbers, by the agent's instance: they are in the map."""
        self._known = dict(heard)

    def receive(self) -> list[tuple[FloatArray, FloatArray]]:
        """Take in what arrived; return the measurements as (times in the controller's clock (m,) [s], (m, d) [m]).

        Every accepted state is in one of them; rows of agents without one are NaN, their times -inf.
        """
        measured: list[list[State]] = [[] for _ in self.links]
        self.restarted = []
        items, self.not_genuine = self._states.drain(), self._states.take_refused()
        self.rejected.update(error.reason for error in self.not_genuine)
        for item in items:
            try:
                index, state = self._accept(item)
            except RejectedError as error:
                self.rejected[error.reason] += 1
            else:
                if state.seq > self._known.get(state.instance, -1) and self._is_of_this_flight(state):
                    measured[index].append(state)
        return [self._round(measured, number) for number in range(max(map(len, measured)))]

    def _is_of_this_flight(self, state: State) -> bool:
        """Return whether a state, where all are signed, is no replay of what was measured in another flight.

        It names this controller, or is of a process that the controller knew whose flight goes on.
        """
        return not self._signed or state.heard == self.identity or state.instance in self._known

    def _accept(self, item: Received) -> tuple[int, State]:
        state = decode_state(item.payload, self._shape[1])
        index = self._index.get(state.agent, -1)
        if index < 0 or agent_of(item.key) != state.agent:
            raise RejectedError(Reason.WRONG_AGENT, f"{state.agent} on {item.key}")
        self._check_instance(self.links[index], state, item.received_s)
        if self.links[index].accept(state, item.received_s):
            self.restarted.append(state.agent)
        if self.on_state is not None:
            self.on_state(index, self.links[index])
        return index, state

    def _check_instance(self, link: AgentLink, state: State, now_s: float) -> None:
        """Turn away other processes of an agent while the one that has its id is here, and dead ones.

        Raises
        ------
        RejectedError
            Its id is taken; or it was replaced, and has not come back.
        """
        if link.state is None or state.instance == link.state.instance:
            return
        alive = self._presence.alive()
        if self._token(link, link.state.instance) in alive and link.silence_s(now_s) <= HELD_S * self.speed:
            self.others[link.id] = state.instance
            raise RejectedError(Reason.OTHER_INSTANCE, f"{link.id} is instance {link.state.instance}")
        if state.instance in link.retired and self._token(link, state.instance) not in alive:
            raise RejectedError(Reason.OLD, f"instance {state.instance} of {link.id} was replaced")

    def _round(self, measured: list[list[State]], number: int) -> tuple[FloatArray, FloatArray]:
        position = np.full(self._shape, np.nan)
        time_s = np.full(self._shape[0], -np.inf)
        for index, states in enumerate(measured):
            if number < len(states):
                position[index] = states[number].position
                time_s[index] = states[number].time_s + self.links[index].offset
        return time_s, position

    def present(self) -> list[str]:
        """Return the ids of the agents whose process has its liveliness token alive."""
        alive = self._presence.alive()
        names = {agent_of(key) for key in alive}
        return [
            link.id
            for link in self.links
            if (link.id in names if link.state is None else self._token(link, link.state.instance) in alive)
        ]

    def token_lost_s(self, link: AgentLink) -> float:
        """Return when an agent's liveliness token was lost last, by the controller's clock [s]; -inf if never."""
        return self._presence.lost_s(self._token(link, link.state.instance)) if link.state else -np.inf

    def _token(self, link: AgentLink, instance: str) -> str:
        return self._keys.agent_alive(link.id, instance)

    def stale(self, now_s: float, timeout_s: float | None = None) -> list[str]:
        """Return the ids whose newest state is older than three state periods, or than a timeout [s]."""
        limit = STALE_PERIODS * self._state_period if timeout_s is None else timeout_s
        return [link.id for link in self.links if link.silence_s(now_s) > limit]

    def not_ready(self, now_s: float, patience_s: float) -> dict[str, str]:
        """Return, by id, why an agent is not ready: not present, not heard just now, or not at rest."""
        present, stale = set(self.present()), set(self.stale(now_s, patience_s))
        reasons = {}
        for link in self.links:
            if link.state is None or link.id not in present or link.id in stale:
                reasons[link.id] = f"{link.id} is not here"
            elif link.state.mission not in {self._mission, *self.earlier_versions}:
                reasons[link.id] = f"{link.id} has another version of this mission"
            elif link.state.speed != self.speed:
                own = f"this controller at {self.speed:g}"
                reasons[link.id] = f"{link.id} runs at --speed {link.state.speed:g}, {own}"
            elif self._signed and link.state.heard != self.identity:
                reasons[link.id] = f"{link.id} has not heard this controller yet"
            elif not link.state.at_rest:
                reasons[link.id] = f"{link.id} still moves"
        return reasons

    def moving(self, now_s: float) -> list[str]:
        """Return the ids that are heard and not at rest."""
        stale = set(self.stale(now_s))
        return [link.id for link in self.links if link.id not in stale and link.state and not link.state.at_rest]

    def standing(self, now_s: float) -> dict[str, tuple[list[float], float]]:
        """Return where agents stand, (d,) [m], and in how many seconds they do, by id.

        Those whose process has died brake from their newest state; those that fly are left out.
        """
        places, present = {}, set(self.present())
        for link, limit in zip(self.links, self._input_max, strict=True):
            if link.state is None:
                continue
            position, velocity = link.planned()
            braking_s = float(np.linalg.norm(velocity)) / float(limit)
            if not braking_s or link.id not in present:
                left_s = max(0.0, link.measured_s() + braking_s - now_s)
                places[link.id] = (position + 0.5 * braking_s * velocity).tolist(), left_s
        return places

    def freeze_clocks(self) -> None:
        """Freeze all clock offsets, as the best estimates so far, for the flight to come."""
        for link in self.links:
            link.freeze_offset()
