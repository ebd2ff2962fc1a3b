"""An agent that needs no controller: it flies by the potential law on what it hears from those in range.

The samples are t_k = t_0 + k T_s by the clock that all share. At t_k it acts on what it decided, and says which state
that leads to at t_(k+1), where it looked at t_k, and what news it has. Half a period later it has heard the states
of its neighbours at t_(k+1), decides on its input from there on, and promises where that leads. So a word has half
a period to arrive, and whoever comes too late makes its neighbours brake, which is safe (`failure_detector`).
"""

from __future__ import annotations

import time
import uuid
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.distributed.setup import check_flyable, make_agent
from mpc_cover.information.build import true_field
from mpc_cover.information.kalman import KalmanMap
from mpc_cover.model.trajectory import SNAP_S
from mpc_cover.service.agent.schedule import STANDSTILL
from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.events import EventLog
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.swarm.radio import FARTHEST_AHEAD
from mpc_cover.service.swarm.radio_link import RadioLink
from mpc_cover.service.swarm.start_agreement import StartAgreement
from mpc_cover.service.swarm.termination import Termination, TerminationDetector
from mpc_cover.service.swarm.vehicle import CommandedVehicle, make_commanded_vehicle

if TYPE_CHECKING:
    from collections import Counter
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray
    from mpc_cover.clock import Clock
    from mpc_cover.distributed.state_report import Report
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.agent.recorder import Recorder
    from mpc_cover.service.protocol.bus import Transport
    from mpc_cover.service.protocol.decoding import Reason


class SwarmAgent:
    """One agent; see the module.

    Parameters
    ----------
    mission, agent_id : which mission, and which of its agents.
    transport, clock : handed in; the clock is the fleet's.
    seed : the fleet's.
    recorder : told the exact motion, piece by piece.
    say : told events in words.

    Attributes
    ----------
    exit_status : 0 once it knows that everything is covered, 1 when time is up or it came too late; None before.
    decide_s : what each decision took [s].

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
        self.decide_s: list[float] = []
        self._mission, self._clock, self._transport = mission, clock, transport
        self._index = mission.fleet.ids.index(agent_id)
        self._fleet = check_flyable(mission)
        self._law = make_agent(mission, self._index, seed)
        self._seed, self._recorder = seed, recorder
        self._period = mission.spec.control.period_s
        self._limit_s = mission.spec.control.time_limit_s
        keys = Keys(mission.spec.name)
        self.events = EventLog(agent_id, transport.publisher(keys.agent_event(agent_id), bus.EVENT), clock, say)
        self._alive_key = keys.agent_alive(agent_id)
        identity = (agent_id, self.instance)
        self._radio = RadioLink(mission, identity, transport, self.events)
        self._agreement = StartAgreement(
            mission, identity, transport, clock, self._radio.codec, seed=seed, speed=speed, events=self.events
        )
        self._vehicle: CommandedVehicle | None = None
        self._begins_s = 0.0
        self._tick = -2  # of half periods: sample k at 2 k, its decision at 2 k + 1
        self._own: Report | None = None
        self._command: FloatArray | None = None
        self._termination = TerminationDetector(self._fleet.size, self._law.lost_after)

    def startup(self) -> None:
        """Show presence."""
        self._mark_start()
        self._transport.announce(self._alive_key)
        self.events.tell("waits", self._agreement.text)

    @property
    def next_time(self) -> float:
        """When the next tick is due [s]."""
        if self._vehicle is not None:
            return self._begins_s + 0.5 * self._tick * self._period
        start = self._agreement.start_s
        return (
            self._agreement.next_time if start is None else min(self._agreement.next_time, start - 2.0 * self._period)
        )

    @property
    def sent(self) -> Counter[str]:
        """Messages and bytes sent in flight."""
        return self._radio.sent

    @property
    def rejected(self) -> Counter[Reason]:
        """Words that were turned away, by reason."""
        return self._radio.rejected

    @property
    def start_s(self) -> float:
        """When mission time 0 is, by the clock [s]; inf before that is agreed on."""
        return np.inf if self._vehicle is None else self._begins_s

    def tick(self) -> None:
        """Do what is due: muster, act, or decide."""
        if self._vehicle is None:
            self._wait()
            return
        sample, half = divmod(self._tick, 2)
        if half:
            self._decide(sample)
        else:
            self._act(sample)
        self._tick += 1

    def shutdown(self) -> None:
        """Come to rest and close the record; the transport is the caller's."""
        if self._vehicle is None:
            self._vehicle = make_commanded_vehicle(
                self._mission, self._fleet, self._index, self._clock.now(), self._seed, self._recorder
            )
        self._vehicle.close()

    def _wait(self) -> None:
        """StartAgreement until the start is agreed on and one period away."""
        self._agreement.tick()
        now, start = self._clock.now(), self._agreement.start_s
        if start is None:
            if self._radio.drain():
                self._give_up("late", "the others fly already: this agent has come too late")
        elif now > start:
            self._give_up("late", "heard of the start after it: this agent has come too late")
        elif now >= start - 2.0 * self._period:
            self._begins_s = start
            self._vehicle = make_commanded_vehicle(
                self._mission, self._fleet, self._index, now, self._seed, self._recorder
            )
            self._mark_start()
            self.events.tell("flies", "flies by the potential law")

    def _mark_start(self) -> None:
        if self._recorder:
            start = self._mission.fleet.start[self._index]
            self._recorder.mark(self._clock.now(), start, np.zeros_like(start))

    def _act(self, sample: int) -> None:
        """At t_sample: hold what was decided, and say where that leads and what was seen here."""
        assert self._vehicle is not None
        looked = None
        if self._own is not None:
            command = self._law.brake(self._own) if self._command is None else self._command
            looked = self._own.position
            self._vehicle.hold(self._begins_s + sample * self._period, command, sample)
        self._command = None
        ahead = sample + 1
        seen = (sample * self._period, looked)
        self._own = self._law.report(ahead, ahead * self._period, *self._vehicle.state, looked=seen)
        self._speak(self._own, self._law.news())
        self._end_if_over(sample)

    def _decide(self, sample: int) -> None:
        """Half a period later: hear, and decide on the input from the next sample on, unless it is too late."""
        assert self._own is not None
        begun = time.perf_counter()
        self._listen(self._own)
        if self._clock.now() > self._begins_s + (sample + 1) * self._period + SNAP_S:
            self._law.miss()
            self.events.tell("late", "has no time to decide, and brakes")
            return
        self._command = self._law.decide(self._own)
        self.decide_s.append(time.perf_counter() - begun)
        self._speak(self._law.promise(self._own, self._command), [])

    def _listen(self, own: Report) -> None:
        """Take in what those in range have said."""
        for report, word in self._radio.hear(own, self._begins_s):
            news = [self._radio.codec.report(note) for note in word.news]
            sane = [each for each in (report, *news) if each.sample <= own.sample + FARTHEST_AHEAD]
            self._law.hear(each for each in sane if each.agent != self._index)
            if word.missing:
                self._law.hear_lack(report.agent, word.missing)

    def _speak(self, own: Report, news: list[Report]) -> None:
        self._radio.say(
            own,
            news,
            start_s=self._begins_s,
            missing=() if own.promised else tuple(self._law.missing),
            owed=self._left(),
            at_rest=float(np.linalg.norm(own.velocity)) <= STANDSTILL,
        )

    def _end_if_over(self, sample: int) -> None:
        """End when everyone knows that nothing is owed, a little later; or when time is up."""
        own = self._own
        assert own is not None
        if sample * self._period >= self._limit_s:
            self._give_up("time", f"gives up after {self._limit_s:g} s: {self._left()} cells are owed by its own map")
            return
        at_rest = float(np.linalg.norm(own.velocity)) <= STANDSTILL
        match self._termination.update(own, self._law.newest, sample, at_rest=at_rest):
            case Termination.KNOWN:
                self.events.tell("covered", "knows that everything is covered")
            case Termination.KNOWN_BY_ALL:
                self.events.tell("complete", f"everything is covered, and everyone knows{self._how_well()}")
            case Termination.OVER:
                self.done, self.exit_status = True, 0

    @property
    def estimate_error(self) -> float | None:
        """By how much this agent's own estimate of the field is off, root mean square; None where none is asked for."""
        known = self._law.known
        if not isinstance(known, KalmanMap):
            return None
        return float(np.sqrt(np.mean((known.estimate - true_field(self._mission)) ** 2)))

    def _how_well(self) -> str:
        error = self.estimate_error
        return "" if error is None else f"; its own estimate of the field is off by {error:.3g} (RMS)"

    def _left(self) -> int:
        return int(self._law.known.owed.any(axis=0).sum())

    def _give_up(self, kind: str, text: str) -> None:
        self.events.tell(kind, text)
        self.done, self.exit_status = True, 1
