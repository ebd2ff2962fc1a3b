"""The agent: plays the newest valid plan to its end, reports where it is, and outlives its controller."""

from __future__ import annotations

import math
import uuid
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.service import bus
from mpc_cover.service.decoding import Reason, RejectedError, decode_plan
from mpc_cover.service.events import EventLog
from mpc_cover.service.fingerprint import mission_hash
from mpc_cover.service.flight import SNAP_S, Flight, Plant, Schedule, flight_of, predict
from mpc_cover.service.keys import Keys
from mpc_cover.service.messages import State, encode
from mpc_cover.service.plan_filter import Authority, check_content, check_start, check_time, limits_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.clock import Clock
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.bus import Received, Transport
    from mpc_cover.service.messages import PlanMessage, PlanRef
    from mpc_cover.service.recorder import Recorder

PLAN_DEPTH = 8
"""Plans kept between two ticks; a controller sends one a period."""


class Agent:
    """One simulated double integrator with its own filter and deadman (3.1, 3.2).

    Parameters
    ----------
    mission, agent_id : which mission, and which of its agents.
    transport, clock : handed in; time stamps are of this clock.
    instance : names this life of the agent; plans for another are refused.
    speed : how many seconds of `clock` pass in one of the machine's.
    recorder : told the exact motion, piece by piece.
    say : told events in words.
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
        recorder: Recorder | None = None,
        say: Callable[[str], None] | None = None,
    ) -> None:
        index = mission.fleet.ids.index(agent_id)
        self.id = agent_id
        self.done = False  # an agent never has enough
        self.instance = instance or uuid.uuid4().hex
        self.rejected: Counter[Reason] = Counter()
        self._clock, self._speed = clock, speed
        self._mission = mission_hash(mission)
        self._transport = transport
        self._recorder = recorder
        self._dimension = mission.fleet.dimension
        self._limits = limits_of(mission, index)
        self._state_period = mission.spec.control.state_period_s
        self._authority = Authority()
        start = mission.fleet.start[index].copy()
        log = recorder.piece if recorder else None
        self.plant = Plant(clock.now(), start, np.zeros_like(start), log)
        self.schedule = Schedule(self._limits.input_max)
        self._report_index = math.ceil(clock.now() / self._state_period)
        self._seq = 0
        keys = Keys(mission.spec.name)
        self._plans = transport.inbox(keys.plan(agent_id), PLAN_DEPTH, history=1)
        self._states = transport.publisher(keys.state(agent_id), bus.STATE)
        events = transport.publisher(keys.agent_event(agent_id), bus.EVENT)
        self.events = EventLog(agent_id, events, clock, say)
        self._alive_key = keys.agent_alive(agent_id)

    def startup(self) -> None:
        """Show presence and report for the first time."""
        self._transport.announce(self._alive_key)
        self._report()

    @property
    def next_time(self) -> float:
        """When the next tick is due, on a grid of the agent's own clock [s]."""
        return self._report_index * self._state_period

    @property
    def at_rest(self) -> bool:
        """Whether it stands still with nothing left to fly."""
        return self.schedule.rests(self.plant.time_s, self.plant.velocity)

    def tick(self) -> None:
        """Move to now, look at the plans that came, report."""
        now = self._clock.now()
        self.plant.advance(now, self.schedule)
        for item in self._plans.drain():
            self._receive(item, now)
        self.schedule.switch(now)
        self._report()
        self._report_index = max(self._report_index + 1, math.floor((now + SNAP_S) / self._state_period) + 1)

    def shutdown(self) -> None:
        """Close the record; the transport is the caller's."""
        self.plant.advance(self._clock.now(), self.schedule)
        if self._recorder:
            self._recorder.close(self.plant.time_s, self.plant.position, self.plant.velocity)

    def _receive(self, item: Received, now: float) -> None:
        try:
            message = decode_plan(item.payload, self._dimension)
            self._authority_check(message)
            flight = flight_of(message)
            check_time(message, now)
            check_content(flight, self._limits)
            self._adopt(flight, now)
        except RejectedError as error:
            self._reject(error)
        else:
            if message.epoch > self._authority.epoch:
                text = f"flies for controller {message.controller[:8]}, epoch {message.epoch}"
                self.events.tell("controller", text)
            self._authority.accept(message)

    def _authority_check(self, message: PlanMessage) -> None:
        if message.agent != self.id:
            raise RejectedError(Reason.WRONG_AGENT, f"for {message.agent}")
        if message.instance != self.instance:
            raise RejectedError(Reason.WRONG_INSTANCE, f"for {message.instance}")
        self._authority.check(message)

    def _adopt(self, flight: Flight, now: float) -> None:
        """Queue a plan that starts where the agent will be then, or join one that is where the agent is now."""
        meeting = max(flight.start_s, now)
        others = Schedule(
            self.schedule.input_max,
            self.schedule.flown,
            tuple(q for q in self.schedule.queue if q.start_s < flight.start_s - SNAP_S),
        )
        check_start(flight.state_at(meeting), predict(self.plant, others, meeting))
        self.schedule.add(flight)

    def _reject(self, error: RejectedError) -> None:
        self.rejected[error.reason] += 1
        if error.reason is not Reason.OLD:  # repeats are harmless, and come with every reconnection
            self.events.tell(error.reason.name.lower(), f"ignores a plan: {error}")

    def _report(self) -> None:
        plant, schedule = self.plant, self.schedule
        state = State(
            agent=self.id,
            instance=self.instance,
            seq=self._seq,
            time_s=plant.time_s,
            position=plant.position.tolist(),
            velocity=plant.velocity.tolist(),
            plan=_ref(schedule.flying(plant.time_s)),
            next_plan=_ref(schedule.queue[0] if schedule.queue else None),
            at_rest=self.at_rest,
            speed=self._speed,
            mission=self._mission,
        )
        self._seq += 1
        self._states.publish(encode(state))


def _ref(flight: Flight | None) -> PlanRef | None:
    return flight.ref if flight else None
