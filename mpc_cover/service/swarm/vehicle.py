"""The simulated vehicle of an agent of the distributed law: it holds a command for a period, and then brakes.

It is moved to the end of each period at the period's start: no command can reach it in between. So a vehicle whose
process dies finishes the period, as its neighbours expect (`distributed.agent_controller`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from mpc_cover.distributed.double_integrator_filter import stopping_balls
from mpc_cover.mission.config import Dynamics
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.service.agent.schedule import Schedule, ScheduledPlan
from mpc_cover.service.agent.vehicle import make_vehicle
from mpc_cover.service.protocol.messages import PlanRef

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.agent.recorder import Recorder


class CommandedVehicle(Protocol):
    """What the agent needs of its vehicle."""

    @property
    def state(self) -> tuple[FloatArray, FloatArray]:
        """Position and velocity (d,) [m], [m/s] that its command leads to by the end of the period."""
        ...

    def hold(self, start_s: float, command: FloatArray, number: int) -> None:
        """Hold a command (d,) for the period that begins at `start_s`: period `number`."""
        ...

    def close(self) -> None:
        """Brake, should it still move, and end the record."""
        ...


class DoubleIntegratorVehicle:
    """A double integrator that tracks its commands, disturbed or not (`service.agent.vehicle`).

    Parameters
    ----------
    fleet : tightened for the mission's disturbances.
    start_s : when it is at rest at its start, by the clock.
    """

    def __init__(
        self, mission: Mission, fleet: Fleet, index: int, start_s: float, seed: int, recorder: Recorder | None
    ) -> None:
        self._period = mission.spec.control.period_s
        self._limit = float(fleet.input_max[index])
        self._recorder = recorder
        self._vehicle = make_vehicle(mission, index, start_s, seed, recorder.piece if recorder else None)
        self._schedule = Schedule(float(mission.fleet.input_max[index]))
        self._end_s = start_s

    @property
    def state(self) -> tuple[FloatArray, FloatArray]:
        """Position and velocity (d,) [m], [m/s] by the end of the period."""
        return self._vehicle.nominal.position, self._vehicle.nominal.velocity

    def hold(self, start_s: float, command: FloatArray, number: int) -> None:
        """Hold a force (d,) [m/s^2] for a period, and brake after it unless another follows."""
        self._vehicle.advance(start_s, self._schedule)
        self._schedule.add(self._plan(start_s, command, number))
        self._end_s = start_s + self._period
        self._vehicle.advance(self._end_s, self._schedule)
        self._mark()

    def close(self) -> None:
        """Brake, and end the record."""
        if self._schedule.flown is not None:
            self._vehicle.advance(max(self._end_s, self._schedule.flown.motion.end_time), self._schedule)
        if self._recorder:
            self._recorder.close(self._vehicle.nominal.time_s, *self._vehicle.truth)

    def _plan(self, start_s: float, force: FloatArray, number: int) -> ScheduledPlan:
        """Return a plan: the force held for a period, then the braking force of `double_integrator_filter`."""
        position, velocity = [self.state[0]], [self.state[1]]
        forces = [force]
        while True:
            held = forces[-1]
            position.append(position[-1] + self._period * velocity[-1] + 0.5 * self._period**2 * held)
            velocity.append(velocity[-1] + self._period * held)
            if float(np.linalg.norm(velocity[-1])) < 1e-9:  # noqa: PLR2004 - at rest
                break
            limit = np.array([self._limit])
            forces.append(stopping_balls(position[-1][None], velocity[-1][None], limit, self._period).force[0])
        ref = PlanRef(0, number)
        motion = Trajectory.even(start_s, self._period, np.array(position), np.array(velocity), np.array(forces))
        return ScheduledPlan(ref, motion)

    def _mark(self) -> None:
        if self._recorder:
            self._recorder.mark(self._vehicle.nominal.time_s, *self._vehicle.truth)


class SingleIntegratorVehicle:
    """A single integrator (5.1): its command is its velocity, and without one it stands still."""

    def __init__(self, mission: Mission, index: int, start_s: float, recorder: Recorder | None) -> None:
        self._period = mission.spec.control.period_s
        self._recorder = recorder
        self._position = mission.fleet.start[index].copy()
        self._still = np.zeros_like(self._position)
        self._end_s = start_s
        if recorder:
            recorder.piece(start_s, self._position, self._still, self._still, None)

    @property
    def state(self) -> tuple[FloatArray, FloatArray]:
        """Position (d,) [m] by the end of the period, and no velocity: the next may be any."""
        return self._position, self._still

    def hold(self, start_s: float, command: FloatArray, number: int) -> None:
        """Move with a velocity (d,) [m/s] for a period."""
        if self._recorder:
            self._recorder.piece(start_s, self._position, command, self._still, PlanRef(0, number))
        self._position = self._position + self._period * command
        self._end_s = start_s + self._period
        if self._recorder:
            self._recorder.mark(self._end_s, self._position, self._still)

    def close(self) -> None:
        """End the record."""
        if self._recorder:
            self._recorder.close(self._end_s, self._position, self._still)


def make_commanded_vehicle(
    mission: Mission, fleet: Fleet, index: int, start_s: float, seed: int, recorder: Recorder | None
) -> CommandedVehicle:
    """Return the vehicle of agent number `index`, at rest at its start at `start_s` of the clock."""
    if mission.spec.fleet.dynamics is Dynamics.SINGLE:
        return SingleIntegratorVehicle(mission, index, start_s, recorder)
    return DoubleIntegratorVehicle(mission, fleet, index, start_s, seed, recorder)
