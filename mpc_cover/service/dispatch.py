"""Plans on their way: cut for each agent, sent in its own clock, and remembered to predict where it will be."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.service import bus
from mpc_cover.service.flight import Flight, Plant, Schedule, flight_of, predict
from mpc_cover.service.keys import Keys
from mpc_cover.service.messages import PlanMessage, PlanRef, encode

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.planning.plan import Plan
    from mpc_cover.service.bus import Transport
    from mpc_cover.service.fleet_view import AgentLink

REMEMBERED = 16
"""Plans kept for each agent: under loss it may still fly an older one."""


class UnknownPlanError(Exception):
    """An agent flies a plan that this controller did not send, or sent too long ago."""


@dataclass(frozen=True, eq=False)
class Sent:
    """A plan sent, and when by the controller's clock [s]."""

    flight: Flight
    sent_s: float


class Dispatch:
    """Sends plans and knows what each agent flies."""

    def __init__(self, mission: Mission, transport: Transport, epoch: int, controller: str) -> None:
        keys = Keys(mission.spec.name)
        self._epoch = epoch
        self._controller = controller
        self._input_max = mission.fleet.input_max
        self._state_period = mission.spec.control.state_period_s
        self._publishers = [transport.publisher(keys.plan(name), bus.PLAN) for name in mission.fleet.ids]
        self._sent: list[deque[Sent]] = [deque(maxlen=REMEMBERED) for _ in mission.fleet.ids]
        self._seq = 0

    def send(self, plan: Plan, links: list[AgentLink], origin_s: float, now_s: float) -> None:
        """Send each agent its part of a plan; mission time 0 is at `origin_s` of the controller's clock."""
        for index, link in enumerate(links):
            message = self._cut(plan, index, link, origin_s)
            self._sent[index].append(Sent(flight_of(message), now_s))
            self._publishers[index].publish(encode(message))
        self._seq += 1

    def forget(self) -> None:
        """Start afresh: everyone is at rest."""
        for sent in self._sent:
            sent.clear()

    def schedule(self, index: int, link: AgentLink) -> Schedule:
        """Return what an agent flies and will fly, by its own report.

        Raises
        ------
        UnknownPlanError
            It reports a plan that is not known here.
        """
        assert link.state is not None
        schedule = Schedule(float(self._input_max[index]), self._find(index, link.state.plan))
        if queued := self._find(index, link.state.next_plan):
            schedule.add(queued)
        newest = self._sent[index][-1] if self._sent[index] else None
        reported = (link.state.plan, link.state.next_plan)
        # agents look at their mail once a state period: a plan this young cannot have been reported yet
        young = newest is not None and link.measured_s() <= newest.sent_s + self._state_period
        if newest and young and newest.flight.ref not in reported:
            schedule.add(newest.flight)
        return schedule

    def predict(self, links: list[AgentLink], time_s: float) -> tuple[FloatArray, FloatArray]:
        """Return where all will be at `time_s` of the controller's clock: (m, d) [m], [m/s].

        Raises
        ------
        UnknownPlanError
            See `schedule`.
        """
        states = []
        for index, link in enumerate(links):
            assert link.state is not None
            plant = Plant(link.state.time_s, np.array(link.state.position), np.array(link.state.velocity))
            states.append(predict(plant, self.schedule(index, link), time_s - link.offset))
        return np.array([q for q, _ in states]), np.array([v for _, v in states])

    def settled(self, links: list[AgentLink]) -> bool:
        """Return whether nobody moves, nor will by any plan that was sent."""
        return all(
            link.state is not None
            and self.schedule(index, link).rests(link.state.time_s, np.array(link.state.velocity))
            for index, link in enumerate(links)
        )

    def _find(self, index: int, ref: PlanRef | None) -> Flight | None:
        if ref is None:
            return None
        for sent in self._sent[index]:
            if sent.flight.ref == ref:
                return sent.flight
        raise UnknownPlanError(f"epoch {ref.epoch}, plan {ref.seq}")

    def _cut(self, plan: Plan, index: int, link: AgentLink, origin_s: float) -> PlanMessage:
        assert link.state is not None
        start_s = origin_s + plan.start_time - link.offset
        return PlanMessage(
            epoch=self._epoch,
            controller=self._controller,
            seq=self._seq,
            agent=link.id,
            instance=link.state.instance,
            start_s=start_s,
            valid_until_s=start_s + plan.period,
            period_s=plan.period,
            position=plan.position[:, index].tolist(),
            velocity=plan.velocity[:, index].tolist(),
            input=plan.input[:, index].tolist(),
        )
