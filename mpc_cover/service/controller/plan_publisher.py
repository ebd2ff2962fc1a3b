"""Publishes plans: judged by the safety filter, cut for each agent, sent in its clock, and remembered.

Nothing else sends a plan.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpc_cover.control.safety_filter import SafetyFilter
from mpc_cover.service.agent.schedule import Schedule, ScheduledPlan, plan_in
from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.protocol.messages import PlanMessage, PlanRef, encode

if TYPE_CHECKING:
    from mpc_cover.control.safety_filter import Verdict
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.service.controller.fleet_monitor import AgentLink
    from mpc_cover.service.protocol.bus import Transport

REMEMBERED = 16
"""Plans kept for each agent: under loss it may still fly an older one."""


class UnknownPlanError(Exception):
    """An agent flies a plan that this controller did not send, or sent too long ago."""


@dataclass(frozen=True, eq=False)
class Sent:
    """A plan sent, and when by the controller's clock [s]."""

    plan: ScheduledPlan
    sent_s: float


class PlanPublisher:
    """Sends plans that the safety filter admits, and knows what each agent flies."""

    def __init__(self, mission: Mission, transport: Transport, epoch: int, controller: str) -> None:
        self._filter = SafetyFilter(mission)
        self._incumbent: Trajectory | None = None
        keys = Keys(mission.spec.name)
        self._epoch = epoch
        self._controller = controller
        self._input_max = mission.fleet.input_max
        self._state_period = mission.spec.control.state_period_s
        self._publishers = [transport.publisher(keys.plan(name), bus.PLAN) for name in mission.fleet.ids]
        self._sent: list[deque[Sent]] = [deque(maxlen=REMEMBERED) for _ in mission.fleet.ids]
        self._seq = 0

    def publish(
        self, trajectory: Trajectory, state: FleetState, links: list[AgentLink], origin_s: float, now_s: float
    ) -> Verdict:
        """Send each agent that takes part its plan, if the safety filter admits the trajectory from this state.

        Mission time 0 is at `origin_s` of the controller's clock, now is `now_s` [s].
        """
        verdict = self._filter.admit(trajectory, state, self._incumbent)
        if not verdict.admitted:
            return verdict
        for index, link in enumerate(links):
            if state.lost[index]:
                continue
            message = self._cut(trajectory, index, link, origin_s)
            self._sent[index].append(Sent(plan_in(message), now_s))
            self._publishers[index].publish(encode(message))
        self._incumbent = trajectory
        self._seq += 1
        return verdict

    def take_up(self, mission: Mission) -> None:
        """Judge by another version of the mission from now on, for the same fleet."""
        self._filter = SafetyFilter(mission)

    def forget(self, index: int) -> None:
        """Forget what was sent to agent number `index`: another one has taken its place."""
        self._sent[index].clear()

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
        for plan in self._unreported(index, link, {link.state.plan, link.state.next_plan}):
            schedule.add(plan)
        return schedule

    def _unreported(self, index: int, link: AgentLink, reported: set[PlanRef | None]) -> list[ScheduledPlan]:
        """Return the plans sent since: agents look at their mail once a state period, so they may well have them.

        Not one that the agent says it turned away: what starts where that one leads is turned away as well.
        """
        assert link.state is not None
        since: list[ScheduledPlan] = []
        for sent in self._sent[index]:
            if sent.plan.ref in reported:
                since = []
            elif link.measured_s() <= sent.sent_s + self._state_period and sent.plan.ref != link.state.refused:
                since.append(sent.plan)
        return since

    def _find(self, index: int, ref: PlanRef | None) -> ScheduledPlan | None:
        if ref is None:
            return None
        for sent in self._sent[index]:
            if sent.plan.ref == ref:
                return sent.plan
        raise UnknownPlanError(f"epoch {ref.epoch}, plan {ref.seq}")

    def _cut(self, plan: Trajectory, index: int, link: AgentLink, origin_s: float) -> PlanMessage:
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
