"""Publishes plans: those that the safety filter admits, to each agent its part, in the agent's clock.

No other module sends plans. Those sent are remembered, to predict what each agent flies.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpc_cover.control.safety_filter import SafetyFilter
from mpc_cover.model.trajectory import SNAP_S
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
"""Plans remembered for each agent: under message loss it may still fly an older one."""


class UnknownPlanError(Exception):
    """An agent flies a plan that this controller did not send, or no longer remembers."""


@dataclass(frozen=True, eq=False)
class Sent:
    """A plan that was sent, and when by the controller's clock [s]."""

    plan: ScheduledPlan
    sent_s: float


class PlanPublisher:
    """Sends plans that the safety filter admits, and returns what each agent flies.

    Attributes
    ----------
    epoch : of the plans to come.
    """

    def __init__(self, mission: Mission, transport: Transport, epoch: int, controller: str) -> None:
        self._filter = SafetyFilter(mission)
        self._incumbent: Trajectory | None = None
        keys = Keys(mission.spec.name)
        self.epoch = epoch
        self._controller = controller
        self._input_max = mission.fleet.input_max
        self._state_period = mission.spec.control.state_period_s
        self._publishers = [transport.publisher(keys.plan(name), bus.PLAN) for name in mission.fleet.ids]
        # an agent that is silent is sent plans for half a horizon, all of which it may hold
        remembered = max(REMEMBERED, 2 * mission.spec.control.horizon_periods)
        self._sent: list[deque[Sent]] = [deque(maxlen=remembered) for _ in mission.fleet.ids]
        self._seq = 0

    def publish(
        self,
        trajectory: Trajectory,
        state: FleetState,
        links: list[AgentLink],
        origin_s: float,
        now_s: float,
        *,
        eased: bool = False,
    ) -> Verdict:
        """Send each agent that is not lost its plan, if the safety filter admits the trajectory from this state.

        Mission time 0 is at `origin_s` of the controller's clock, the present is `now_s` [s]; `eased` as in
        `held_plans.crossing`.
        """
        verdict = self._filter.admit(trajectory, state, self._incumbent, eased=eased)
        if not verdict.admitted:
            return verdict
        for index, link in enumerate(links):
            if state.lost[index]:
                continue
            message = self._message(trajectory, index, link, origin_s)
            self._sent[index].append(Sent(plan_in(message), now_s))
            self._publishers[index].publish(encode(message))
        self._incumbent = trajectory
        self._seq += 1
        return verdict

    def earliest_stop(self, state: FleetState, *, on_sample: bool) -> Trajectory | None:
        """Return the earliest motion to rest that the safety filter admits; see `SafetyFilter.earliest_stop`."""
        return self._filter.earliest_stop(state, self._incumbent, on_sample=on_sample)

    @property
    def last_ref(self) -> PlanRef | None:
        """The id of the newest plan; None before the first."""
        return PlanRef(self.epoch, self._seq - 1) if self._seq else None

    def set_mission(self, mission: Mission) -> None:
        """Filter by another version of the mission from now on, for the same fleet."""
        self._filter = SafetyFilter(mission)

    def forget(self, index: int) -> None:
        """Forget what was sent to agent number `index`: another process has replaced it."""
        self._sent[index].clear()

    def schedule(self, index: int, link: AgentLink) -> Schedule:
        """Return the plans that an agent flies and will fly, by its own report and by what was sent since.

        Raises
        ------
        UnknownPlanError
            It reports a plan that is not known here.
        """
        assert link.state is not None
        schedule = Schedule(float(self._input_max[index]), self.find(index, link.state.plan))
        if queued := self.find(index, link.state.next_plan):
            schedule.add(queued)
        for plan in self._unreported(index, link, {link.state.plan, link.state.next_plan}):
            schedule.add(plan)
        return schedule

    def may_fly(self, index: int, link: AgentLink, time_s: float) -> list[ScheduledPlan]:
        """Return the plans of which an agent flies one from `time_s` on: reported, or sent since.

        Agents take up a plan no later than it is valid, and none that is older than what they have.

        Raises
        ------
        UnknownPlanError
            It reports a plan that is not known here.
        """
        assert link.state is not None
        state, newest = link.state, -1
        found: list[ScheduledPlan] = []
        for ref in (state.plan, state.next_plan):
            if (plan := self.find(index, ref)) is not None:
                begun = plan.motion.start_time + link.offset <= time_s + SNAP_S
                found = [plan] if begun else [*found, plan]  # it switches by itself
                newest = plan.ref.seq
        for sent in self._sent[index]:
            ref, latest_s = sent.plan.ref, sent.plan.motion.start_time + sent.plan.motion.period
            if ref.seq > newest and ref != state.refused and state.time_s <= latest_s:
                found.append(sent.plan)
        return found

    def _unreported(self, index: int, link: AgentLink, reported: set[PlanRef | None]) -> list[ScheduledPlan]:
        """Return the plans sent since the report: agents read messages once a state period, so they may have them.

        Without one that the agent says it rejected, as the plans that start from its states are rejected as well.
        """
        assert link.state is not None
        since: list[ScheduledPlan] = []
        for sent in self._sent[index]:
            if sent.plan.ref in reported:
                since = []
            elif link.measured_s() <= sent.sent_s + self._state_period and sent.plan.ref != link.state.refused:
                since.append(sent.plan)
        return since

    def sent(self, index: int) -> list[ScheduledPlan]:
        """Return the plans that agent number `index` was sent, as far as they are remembered."""
        return [sent.plan for sent in self._sent[index]]

    def find(self, index: int, ref: PlanRef | None) -> ScheduledPlan | None:
        """Return the plan with an id that was sent to agent number `index`; None for no id.

        Raises
        ------
        UnknownPlanError
            It is not known here.
        """
        if ref is None:
            return None
        for sent in self._sent[index]:
            if sent.plan.ref == ref:
                return sent.plan
        raise UnknownPlanError(f"epoch {ref.epoch}, plan {ref.seq}")

    def _message(self, plan: Trajectory, index: int, link: AgentLink, origin_s: float) -> PlanMessage:
        assert link.state is not None
        start_s = origin_s + plan.start_time - link.offset
        return PlanMessage(
            epoch=self.epoch,
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
