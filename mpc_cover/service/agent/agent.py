"""The agent: it flies the newest valid plan to its end, with or without a controller, and reports its state."""

from __future__ import annotations

import math
import uuid
from collections import Counter, deque
from typing import TYPE_CHECKING

from mpc_cover.model.trajectory import SNAP_S
from mpc_cover.service.agent.controller_watch import ControllerWatch
from mpc_cover.service.agent.plan_filter import Authority, check_content, check_start, check_time, limits_of
from mpc_cover.service.agent.schedule import Schedule, ScheduledPlan, plan_in, predict
from mpc_cover.service.agent.vehicle import make_vehicle
from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.decoding import Reason, RejectedError, decode_plan
from mpc_cover.service.protocol.events import EventLog
from mpc_cover.service.protocol.fingerprint import mission_hash
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.protocol.messages import State, encode

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray
    from mpc_cover.clock import Clock
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.agent.recorder import Recorder
    from mpc_cover.service.protocol.bus import Received, Transport
    from mpc_cover.service.protocol.messages import PlanMessage, PlanRef

PLAN_DEPTH = 8
"""Plans kept between two ticks; a controller sends one a period."""


class Agent:
    """One simulated double integrator with its own plan filter and deadman brake (3.1, 3.2).

    Parameters
    ----------
    mission, agent_id : which mission, and which of its agents.
    transport, clock : the network, and the clock of all time stamps.
    instance : identifies this process of the agent; plans for another are rejected.
    speed : how many seconds of `clock` pass in one of the machine's.
    seed : with the agent's number, of its disturbances.
    recorder : records the exact motion, piece by piece.
    say : called with the text of each event.
    place : where its vehicle stands, (d,) [m]; left out, at the mission's start.
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
        place: FloatArray | None = None,
    ) -> None:
        index = mission.fleet.ids.index(agent_id)
        self.id = agent_id
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
        self._refused: PlanRef | None = None
        self.vehicle = make_vehicle(mission, index, clock.now(), seed, recorder.piece if recorder else None, place)
        self.plant = self.vehicle.nominal
        self.schedule = Schedule(self._limits.input_max)
        self._inbox_s = mission.spec.control.inbox_s
        self._report_index = math.ceil(clock.now() / self._state_period)
        self._read_index = math.ceil(clock.now() / self._inbox_s)
        self._delay_s = mission.spec.disturbance.delay_s
        self._outbox: deque[tuple[float, bytes]] = deque()
        self._seq = 0
        keys = Keys(mission.spec.name)
        self._plans = transport.inbox(keys.plan(agent_id), PLAN_DEPTH, history=1)
        self._states = transport.publisher(keys.state(agent_id), bus.STATE)
        events = transport.publisher(keys.agent_event(agent_id), bus.EVENT)
        self.events = EventLog(agent_id, events, clock, say)
        self._alive_key = keys.agent_alive(agent_id, self.instance)
        self._controllers = ControllerWatch(mission, agent_id, self.instance, transport, self.events, speed=speed)

    def startup(self) -> None:
        """Announce presence and report the state for the first time."""
        self._transport.announce(self._alive_key)
        self._report()
        self._send_due(self._clock.now())

    @property
    def next_time(self) -> float:
        """When the next tick is due, on a grid of the agent's own clock, or a delayed report [s]."""
        due_s = min(self._report_index * self._state_period, self._read_index * self._inbox_s)
        return min(due_s, self._outbox[0][0]) if self._outbox else due_s

    @property
    def taken_by(self) -> str:
        """The instance of another process that is this agent for the controller; empty as long as this one may be."""
        return self._controllers.taken_by

    @property
    def done(self) -> bool:
        """Whether it has nothing left to do: it runs until it is stopped, unless its id is taken."""
        return bool(self.taken_by) and self.at_rest

    @property
    def at_rest(self) -> bool:
        """Whether it stands still, within its tracking error, with nothing left to fly."""
        return self.schedule.rests(self.plant.time_s, self.plant.velocity) and self.vehicle.on_track

    def tick(self) -> None:
        """Move to the present time, take in the plans that arrived, report the state."""
        now = self._clock.now()
        reporting = now >= self._report_index * self._state_period - SNAP_S
        if self._inbox_s == self._state_period and not self._delay_s:
            reporting = True  # whenever it is ticked
        if reporting or now >= self._read_index * self._inbox_s - SNAP_S:
            self.vehicle.advance(now, self.schedule)
            for item in self._plans.drain():
                self._receive(item, now)
            for error in self._plans.take_refused():
                self._reject(error)
            self.vehicle.advance(now, self.schedule)
            self._controllers.tick(now)
            self._read_index = max(self._read_index + 1, math.floor((now + SNAP_S) / self._inbox_s) + 1)
        if reporting:
            self._report()
            self._report_index = max(self._report_index + 1, math.floor((now + SNAP_S) / self._state_period) + 1)
        self._send_due(now)

    def shutdown(self) -> None:
        """Close the record; the caller closes the transport."""
        self.vehicle.advance(self._clock.now(), self.schedule)
        if self._recorder:
            self._recorder.close(self.plant.time_s, *self.vehicle.truth)

    def _receive(self, item: Received, now: float) -> None:
        try:
            message = decode_plan(item.payload, self._dimension)
            self._check_addressee(message)
            self._refused = message.ref  # until it has passed the other checks, too
            plan = plan_in(message)
            check_time(message, now)
            check_content(plan.motion, self._limits)
            self._adopt(plan, now)
        except RejectedError as error:
            self._reject(error)
        else:
            self._refused = None
            if message.epoch > self._authority.epoch:
                text = f"flies for controller {message.controller[:8]}, epoch {message.epoch}"
                self.events.emit("controller", text)
            self._authority.accept(message)

    def _check_addressee(self, message: PlanMessage) -> None:
        if message.agent != self.id:
            raise RejectedError(Reason.WRONG_AGENT, f"for {message.agent}")
        if message.instance != self.instance:
            raise RejectedError(Reason.WRONG_INSTANCE, f"for {message.instance}")
        self._authority.check(message)

    def _adopt(self, plan: ScheduledPlan, now: float) -> None:
        """Queue a plan that starts in the agent's state at that time, or switch to one that passes through it now."""
        joint_s = max(plan.motion.start_time, now)
        before = Schedule(
            self.schedule.input_max,
            self.schedule.flown,
            tuple(q for q in self.schedule.queue if q.motion.start_time < plan.motion.start_time - SNAP_S),
        )
        planned = plan.motion.at(joint_s)
        if not self.vehicle.can_reach(*planned, joint_s):
            check_start(planned, predict(self.plant, before, joint_s), self._limits.start_tolerance)
        self.schedule.add(plan)

    def _reject(self, error: RejectedError) -> None:
        self.rejected[error.reason] += 1
        if error.reason is not Reason.OLD:  # repeats are harmless, and come with every reconnection
            self.events.emit(error.reason.name.lower(), f"ignores a plan: {error}")

    def _report(self) -> None:
        plant, schedule, reference = self.plant, self.schedule, self.vehicle.reference
        position, velocity = self.vehicle.measured
        state = State(
            agent=self.id,
            instance=self.instance,
            seq=self._seq,
            time_s=plant.time_s,
            position=position.tolist(),
            velocity=velocity.tolist(),
            plan=_ref(schedule.flying(plant.time_s)),
            next_plan=_ref(schedule.queue[0] if schedule.queue else None),
            at_rest=self.at_rest,
            speed=self._speed,
            mission=self._mission,
            reference_position=reference[0].tolist() if reference else None,
            reference_velocity=reference[1].tolist() if reference else None,
            refused=self._refused,
            epoch=max(self._authority.epoch, 0),
            controller=self._authority.controller,
            heard=self._controllers.controller,
        )
        self._seq += 1
        if self._recorder:
            self._recorder.mark(plant.time_s, *self.vehicle.truth)
        self._outbox.append((plant.time_s + self._delay_s, encode(state)))

    def _send_due(self, now: float) -> None:
        """Send the reports whose delay is over."""
        while self._outbox and self._outbox[0][0] <= now + SNAP_S:
            self._states.publish(self._outbox.popleft()[1])


def _ref(plan: ScheduledPlan | None) -> PlanRef | None:
    return plan.ref if plan else None
