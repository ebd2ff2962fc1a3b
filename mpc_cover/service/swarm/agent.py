"""An agent that needs no controller: it flies by the potential law on what it receives from agents in range.

The samples are t_k = t_0 + k T_s by the clock that all share. At t_k it applies what it decided, and broadcasts which
state that leads to at t_(k+1), where it measured at t_k, and the reports that it relays. Half a period later it has
received the states of its neighbours at t_(k+1), decides on its input from there on, and broadcasts the state that
this leads to. So a broadcast has half a period to arrive, and an agent whose broadcast is late makes its neighbours
brake, which is safe (`distributed.failure_detector`).
"""

from __future__ import annotations

import time
import uuid
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.distributed.setup import check_flyable, make_agent
from mpc_cover.information.build import estimate_error
from mpc_cover.model.trajectory import SNAP_S
from mpc_cover.service.agent.schedule import STANDSTILL
from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.events import EventLog
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.swarm.radio_link import RadioLink
from mpc_cover.service.swarm.start_agreement import StartAgreement
from mpc_cover.service.swarm.termination import Termination, TerminationDetector
from mpc_cover.service.swarm.vehicle import CommandedVehicle, make_commanded_vehicle

if TYPE_CHECKING:
    from collections import Counter
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray
    from mpc_cover.clock import Clock
    from mpc_cover.distributed.state_report import StateReport
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.agent.recorder import Recorder
    from mpc_cover.service.protocol.bus import Transport
    from mpc_cover.service.protocol.decoding import Reason


class SwarmAgent:
    """One agent of a fleet without a controller.

    Parameters
    ----------
    mission, agent_id : which mission, and which of its agents.
    transport, clock : the network, and the clock that the fleet shares.
    seed : the fleet's.
    recorder : records the exact motion, piece by piece.
    say : called with the text of each event.

    Attributes
    ----------
    exit_status : 0 once it knows that everything is covered, 1 when time is up or it came too late; None before.
    decision_times_s : how long each decision took [s].

    Raises
    ------
    UserError
        The law cannot fly this mission.
    """

    def __init__(
        self,
        mission: Mission,
        agent_id: str,
        transport: Transport,
        clock: Clock,
        *,
        instance: str | None = None,
        speed: float = 1.0,
        seed: int = 0,
        recorder: Recorder | None = None,
        say: Callable[[str], None] | None = None,
    ) -> None:
        self.id, self.instance = agent_id, instance or uuid.uuid4().hex
        self.done = False
        self.exit_status: int | None = None
        self.decision_times_s: list[float] = []
        self._mission, self._clock, self._transport = mission, clock, transport
        self._index = mission.fleet.ids.index(agent_id)
        self._fleet = check_flyable(mission)
        self._law = make_agent(mission, self._index, seed)
        self._seed, self._recorder = seed, recorder
        self._period = mission.spec.control.period_s
        self._limit_s = mission.spec.control.time_limit_s
        keys = Keys(mission.spec.name)
        self.events = EventLog(agent_id, transport.publisher(keys.agent_event(agent_id), bus.EVENT), clock, say)
        self._alive_key = keys.agent_alive(agent_id, self.instance)
        identity = (agent_id, self.instance)
        self._radio = RadioLink(mission, identity, transport, self.events)
        self._agreement = StartAgreement(
            mission, identity, transport, clock, self._radio.codec, seed=seed, speed=speed, events=self.events
        )
        self._vehicle: CommandedVehicle | None = None
        self._origin_s = 0.0
        self._tick = -2  # of half periods: sample k at 2 k, its decision at 2 k + 1
        self._own: StateReport | None = None
        self._command: FloatArray | None = None
        self._termination = TerminationDetector(self._fleet.size, self._law.lost_after)

    def startup(self) -> None:
        """Announce presence."""
        self._mark_start()
        self._transport.announce(self._alive_key)
        self.events.emit("waits", self._agreement.text)

    @property
    def next_time(self) -> float:
        """When the next tick is due [s]."""
        if self._vehicle is not None:
            return self._origin_s + 0.5 * self._tick * self._period
        announcement_s, start_s = self._agreement.next_time, self._agreement.start_s
        return announcement_s if start_s is None else min(announcement_s, start_s - 2.0 * self._period)

    @property
    def sent(self) -> Counter[str]:
        """Messages and bytes sent in flight."""
        return self._radio.sent

    @property
    def rejected(self) -> Counter[Reason]:
        """Broadcasts that were rejected, by reason."""
        return self._radio.rejected

    @property
    def start_s(self) -> float:
        """When mission time 0 is, by the clock [s]; inf before that is agreed on."""
        return np.inf if self._vehicle is None else self._origin_s

    def tick(self) -> None:
        """Do what is due: agree on the start, apply the command of a sample, or decide on the next one."""
        if self._vehicle is None:
            self._agree_on_start()
            return
        sample, half = divmod(self._tick, 2)
        if half:
            self._decide(sample)
        else:
            self._apply(sample)
        self._tick += 1

    def shutdown(self) -> None:
        """Come to rest and close the record; the transport is the caller's."""
        if self._vehicle is None:
            self._vehicle = make_commanded_vehicle(
                self._mission, self._fleet, self._index, self._clock.now(), self._seed, self._recorder
            )
        self._vehicle.close()

    def _agree_on_start(self) -> None:
        """Take part in the start agreement; two periods before the start, get ready to fly."""
        self._agreement.tick()
        now, start_s = self._clock.now(), self._agreement.start_s
        if start_s is None:
            if self._radio.drain():
                self._give_up("late", "the others fly already: this agent has come too late")
        elif now > start_s:
            self._give_up("late", "heard of the start after it: this agent has come too late")
        elif now >= start_s - 2.0 * self._period:
            self._origin_s = start_s
            self._vehicle = make_commanded_vehicle(
                self._mission, self._fleet, self._index, now, self._seed, self._recorder
            )
            self._mark_start()
            self.events.emit("flies", "flies by the potential law")

    def _mark_start(self) -> None:
        if self._recorder:
            start = self._mission.fleet.start[self._index]
            self._recorder.mark(self._clock.now(), start, np.zeros_like(start))

    def _apply(self, sample: int) -> None:
        """At t_sample: hold what was decided, and broadcast where that leads and what was measured here."""
        assert self._vehicle is not None
        looked = None
        if self._own is not None:
            command = self._law.brake(self._own) if self._command is None else self._command
            looked = self._own.position
            self._vehicle.hold(self._origin_s + sample * self._period, command, sample)
        self._command = None
        ahead = sample + 1
        seen = (sample * self._period, looked)
        self._own = self._law.report(ahead, ahead * self._period, *self._vehicle.state, looked=seen)
        self._broadcast(self._own, self._law.reports_to_relay())
        self._end_if_over(sample)

    def _decide(self, sample: int) -> None:
        """Half a period later: receive, and decide on the input from the next sample on, unless it is too late."""
        assert self._own is not None
        begun = time.perf_counter()
        for reception in self._radio.receive(self._own, self._origin_s):
            self._law.receive(each for each in reception.reports if each.agent != self._index)
            if reception.missing:
                self._law.receive_missing(reception.sender, reception.missing)
        if self._clock.now() > self._origin_s + (sample + 1) * self._period + SNAP_S:
            self._law.miss_deadline()
            self.events.emit("late", "has no time to decide, and brakes")
            return
        self._command = self._law.decide(self._own)
        self.decision_times_s.append(time.perf_counter() - begun)
        self._broadcast(self._law.promise(self._own, self._command), [])

    def _broadcast(self, own: StateReport, relayed: list[StateReport]) -> None:
        self._radio.broadcast(
            own,
            relayed,
            start_s=self._origin_s,
            missing=() if own.promised else tuple(self._law.missing),
            owed=self._owed_count(),
            at_rest=float(np.linalg.norm(own.velocity)) <= STANDSTILL,
        )

    def _end_if_over(self, sample: int) -> None:
        """End soon after all agents know that nothing is owed, or when time is up."""
        own = self._own
        assert own is not None
        if sample * self._period >= self._limit_s:
            owed = f"{self._owed_count()} cells are owed by its own map"
            self._give_up("time", f"gives up after {self._limit_s:g} s: {owed}")
            return
        at_rest = float(np.linalg.norm(own.velocity)) <= STANDSTILL
        match self._termination.update(own, self._law.newest, sample, at_rest=at_rest):
            case Termination.KNOWN:
                self.events.emit("covered", "knows that everything is covered")
            case Termination.KNOWN_BY_ALL:
                error = self.estimate_error
                accuracy = "" if error is None else f"; its own estimate of the field is off by {error:.3g} (RMS)"
                self.events.emit("complete", f"everything is covered, and everyone knows{accuracy}")
            case Termination.OVER:
                self.done, self.exit_status = True, 0

    @property
    def estimate_error(self) -> float | None:
        """Error of this agent's own estimate of the field, root mean square; None where none is asked for."""
        return estimate_error(self._mission, self._law.known)

    def _owed_count(self) -> int:
        return int(self._law.known.owed.any(axis=0).sum())

    def _give_up(self, kind: str, text: str) -> None:
        self.events.emit(kind, text)
        self.done, self.exit_status = True, 1
