"""Where an agent will be: along its plans if it keeps to them, else along what it can do to get back to them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.disturbance import disturbs_motion, undisturbed
from mpc_cover.model.trajectory import SNAP_S
from mpc_cover.model.tube import tracking_of
from mpc_cover.service.agent.recorder import MemoryRecorder
from mpc_cover.service.agent.schedule import START_TOLERANCE, Plant, Reference, Schedule, predict
from mpc_cover.service.agent.vehicle import TrackingVehicle
from mpc_cover.service.controller.plan_publisher import UnknownPlanError

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.agent.vehicle import MotionState
    from mpc_cover.service.controller.fleet_monitor import AgentLink
    from mpc_cover.service.controller.plan_publisher import PlanPublisher


class StatePredictor:
    """Predicts agents from their newest states, to times of the controller's clock.

    An agent within its tube is predicted along its reference, as the tube is what plans keep clear of others; one
    outside it, from where it measured itself, without noise and wind, by the feedback that it flies with.
    """

    def __init__(self, mission: Mission, plan_publisher: PlanPublisher) -> None:
        fleet = mission.fleet
        self._mission, self._plan_publisher = mission, plan_publisher
        self._input_max, self._speed_max = fleet.input_max, fleet.speed_max
        self._state_period_s = mission.spec.control.state_period_s
        self._tracking = tracking_of(mission) if disturbs_motion(mission.spec.disturbance) else None

    def strays(self, link: AgentLink) -> bool:
        """Return whether an agent measures itself outside its tube."""
        if self._tracking is None:
            return False
        (here, now), (position, velocity) = link.measured(), link.planned()
        return not self._tracking.contains(here - position, now - velocity, START_TOLERANCE)

    def ahead(self, index: int, link: AgentLink, time_s: float, speed_max: float) -> MotionState:
        """Return where agent number `index` will be, if it reaches `speed_max` [m/s] at most.

        Raises
        ------
        UnknownPlanError
            It flies a plan that this controller did not send.
        """
        schedule, at_s = self._plan_publisher.schedule(index, link), time_s - link.offset
        assert link.state is not None
        if self._tracking is None:
            return predict(Plant(link.state.time_s, *link.measured()), schedule, at_s)
        reference = Reference(link.state.time_s, *link.planned(), flown=schedule.flown)
        if not self.strays(link):
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

    def braked(self, index: int, link: AgentLink, time_s: float, died_s: float) -> MotionState:
        """Return where agent number `index` is at `time_s` when it has braked hardest ever since it died."""
        plant = self._at_death(index, link, died_s)
        return predict(plant, Schedule(float(self._input_max[index])), time_s - link.offset)

    def course(self, index: int, link: AgentLink, end_s: float, died_s: float | None) -> MemoryRecorder:
        """Return the motion of agent number `index` up to `end_s`, as its own clock has it.

        From its death on as hard as it can brake, or without one along its plans.

        Raises
        ------
        UnknownPlanError
            See `ahead`.
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
        """Return an agent as it was when it last moved by its plans.

        That is its newest report; but with delays, those that it had still to send died with it: it flew on until the
        last state period before its death.
        """
        assert link.state is not None
        newest = Plant(link.state.time_s, *link.measured())
        last_s = (np.ceil((died_s - link.offset - SNAP_S) / self._state_period_s) - 1.0) * self._state_period_s
        if link.delay_s == 0.0 or not last_s > newest.time_s:
            return newest
        try:
            position, velocity = self.ahead(index, link, last_s + link.offset, np.inf)
        except UnknownPlanError:
            return newest
        return Plant(last_s, position, velocity)

    def settled(self, index: int, link: AgentLink) -> bool:
        """Return whether an agent does not move, nor will by any plan that was sent.

        Raises
        ------
        UnknownPlanError
            See `ahead`.
        """
        assert link.state is not None
        return self._plan_publisher.schedule(index, link).rests(link.state.time_s, link.planned()[1])


def resting(position: FloatArray) -> MotionState:
    """Return the state of an agent that stands still at (d,) [m]."""
    return position, np.zeros_like(position)
