"""Predicts the states of agents: along their plans, or for agents off track by the feedback that leads back to them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.disturbance import disturbs_motion, undisturbed
from mpc_cover.model.trajectory import SNAP_S, Trajectory
from mpc_cover.model.tube import tracking_of
from mpc_cover.service.agent.recorder import MemoryRecorder
from mpc_cover.service.agent.schedule import Plant, Reference, Schedule, predict
from mpc_cover.service.agent.vehicle import TrackingVehicle
from mpc_cover.service.controller.plan_publisher import UnknownPlanError

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.agent.vehicle import MotionState
    from mpc_cover.service.controller.fleet_monitor import AgentLink
    from mpc_cover.service.controller.plan_publisher import PlanPublisher

_OFF_MAX = 0.1
"""Distance from its plan, in sensing radii, from which an agent's reports are not believed: far above rounding and the
tolerance of a plan's start. Plain choice. Disturbed agents are asked for what they track, not for where they are."""


class StatePredictor:
    """Predicts agents from their newest reports, to times of the controller's clock.

    An agent within its tube is predicted along its reference, as plans keep the tubes of agents apart; one outside
    it, from its measured state, without noise and wind, by the feedback that it flies with.
    """

    def __init__(self, mission: Mission, plan_publisher: PlanPublisher) -> None:
        fleet = mission.fleet
        self._mission, self._plan_publisher = mission, plan_publisher
        self._input_max, self._speed_max = fleet.input_max, fleet.speed_max
        self._state_period_s = mission.spec.control.state_period_s
        self._off_max_m = _OFF_MAX * fleet.sensing_radius_min
        self._tracking = tracking_of(mission) if disturbs_motion(mission.spec.disturbance) else None

    def off_track(self, link: AgentLink) -> bool:
        """Return whether an agent's measured state is outside its tube."""
        if self._tracking is None:
            return False
        (here, now), (position, velocity) = link.measured(), link.planned()
        return not self._tracking.contains(here - position, now - velocity)

    def predict(self, index: int, link: AgentLink, time_s: float, speed_max: float) -> MotionState:
        """Return the state of agent number `index` at `time_s`, if it reaches `speed_max` [m/s] at most.

        Raises
        ------
        UnknownPlanError
            It flies a plan that this controller did not send.
        """
        schedule, at_s = self._plan_publisher.schedule(index, link), time_s - link.offset
        assert link.state is not None
        if self._tracking is None:
            return predict(Plant(link.state.time_s, *link.measured()), schedule, at_s)
        same = self._tracking.start_tolerance
        reference = Reference(link.state.time_s, *link.planned(), flown=schedule.flown, start_tolerance=same)
        if not self.off_track(link):
            return predict(reference, schedule, at_s)
        vehicle = TrackingVehicle(
            reference,
            link.measured(),
            self._tracking,
            undisturbed(self._mission, speed_max),
            input_max=float(self._input_max[index]),
            speed_max=float(self._speed_max[index]),
        )
        vehicle.advance(at_s, schedule)
        return vehicle.truth

    def predict_braked(self, index: int, link: AgentLink, time_s: float, died_s: float) -> MotionState:
        """Return the state of agent number `index` at `time_s` if it brakes with full input since its death."""
        plant = self._at_death(index, link, died_s)
        return predict(plant, Schedule(float(self._input_max[index])), time_s - link.offset)

    def motion(self, index: int, link: AgentLink, end_s: float, died_s: float | None) -> MemoryRecorder:
        """Return the motion of agent number `index` up to `end_s`, in its own clock.

        It brakes with full input since its death, or without one follows its plans.

        Raises
        ------
        UnknownPlanError
            See `predict`.
        """
        assert link.state is not None
        record = MemoryRecorder()
        if died_s is None:
            plant, schedule = Plant(link.state.time_s, *link.planned()), self._plan_publisher.schedule(index, link)
        else:
            plant, schedule = self._at_death(index, link, died_s), Schedule(float(self._input_max[index]))
        plant.log = record.piece
        plant.advance(end_s - link.offset, schedule)
        record.mark(plant.time_s, plant.position, plant.velocity)
        return record

    def _at_death(self, index: int, link: AgentLink, died_s: float) -> Plant:
        """Return an agent's state when it last moved by its plans.

        That is its newest report; but with delays, reports not sent yet were lost with the process: the agent flew on
        until the last state period before its death.
        """
        assert link.state is not None
        newest = Plant(link.state.time_s, *link.measured())
        last_s = (np.ceil((died_s - link.offset - SNAP_S) / self._state_period_s) - 1.0) * self._state_period_s
        if link.delay_s == 0.0 or not last_s > newest.time_s:
            return newest
        try:
            position, velocity = self.predict(index, link, last_s + link.offset, np.inf)
        except UnknownPlanError:
            return newest
        return Plant(last_s, position, velocity)

    def contradicts(self, index: int, link: AgentLink) -> bool:
        """Return whether an agent reports a place where the plan that it says to fly does not lead at that time."""
        if link.state is None or link.state.plan is None:
            return False
        try:
            plan = self._plan_publisher.find(index, link.state.plan)
        except UnknownPlanError:
            return False
        assert plan is not None
        off = np.linalg.norm(link.planned()[0] - plan.motion.at(link.state.time_s)[0])
        return bool(off > self._off_max_m)

    def rests_at_an_end(self, index: int, link: AgentLink) -> bool:
        """Return whether an agent reports the end of a plan that it was sent: where it is, if it speaks true."""
        here = link.measured()[0]
        ends = [plan.motion.position[-1] for plan in self._plan_publisher.sent(index)]
        return any(bool(np.linalg.norm(here - end) <= self._off_max_m) for end in ends)

    def held_if_not_believed(self, index: int, link: AgentLink) -> list[Trajectory]:
        """Return the motions, in its own clock, of which an agent flies one whose reports are not believed."""
        sent = (plan.motion for plan in self._plan_publisher.sent(index))
        return [self._rest_at(link, link.measured()[0]), *sent]

    def held(self, index: int, link: AgentLink, time_s: float) -> list[Trajectory]:
        """Return the motions, in its own clock, of which an agent flies one from `time_s` of the controller's on.

        They are those of its plans, or rest where it is.

        Raises
        ------
        UnknownPlanError
            See `predict`.
        """
        assert link.state is not None
        motions = [plan.motion for plan in self._plan_publisher.may_fly(index, link, time_s)]
        if link.state.plan is not None or link.state.next_plan is not None:
            return motions
        return [self._rest_at(link, link.planned()[0]), *motions]

    def _rest_at(self, link: AgentLink, position: FloatArray) -> Trajectory:
        """Return the motion, in its clock, of an agent that stays at (d,) [m] from its newest report on."""
        assert link.state is not None
        return Trajectory.at_rest(position, link.state.time_s, self._state_period_s, 1)

    def settled(self, index: int, link: AgentLink) -> bool:
        """Return whether an agent is at rest, and has no plan left that moves it.

        Raises
        ------
        UnknownPlanError
            See `predict`.
        """
        assert link.state is not None
        return self._plan_publisher.schedule(index, link).rests(link.state.time_s, link.planned()[1])


def resting(position: FloatArray) -> MotionState:
    """Return the state of an agent at rest at (d,) [m]."""
    return position, np.zeros_like(position)
