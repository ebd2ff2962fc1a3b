"""The simulated vehicle of an agent: its true state, and its measured state.

Without disturbances it follows its plans to the last bit. With them its plans move a reference, which the vehicle
tracks: at each state period it measures its state and corrects the input by K (z_ref - z_measured), see
`model.tube`. The agent's own input stays so far below its limit that the sum with gusts and wind does, too. The total
acceleration is recorded, from which the recorded motion follows exactly.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

import numpy as np

from mpc_cover.model.disturbance import agent_disturbance, disturbs_motion, saturated_acceleration
from mpc_cover.model.trajectory import SNAP_S
from mpc_cover.model.tube import tracking_of
from mpc_cover.service.agent.schedule import Plant, Reference

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.disturbance import AgentDisturbance
    from mpc_cover.model.tube import Tracking
    from mpc_cover.service.agent.schedule import Schedule
    from mpc_cover.service.protocol.messages import PlanRef

    Log = Callable[[float, FloatArray, FloatArray, FloatArray, PlanRef | None], None]
    MotionState = tuple[FloatArray, FloatArray]
    """Position and velocity, (d,) [m], [m/s]."""


class Vehicle(Protocol):
    """What an agent needs of its vehicle; `nominal` is the motion that its plans give."""

    nominal: Plant

    @property
    def truth(self) -> MotionState:
        """Its true state."""
        ...

    @property
    def measured(self) -> MotionState:
        """Its measured state."""
        ...

    @property
    def reference(self) -> MotionState | None:
        """The reference state that it tracks; None when it follows its plans exactly."""
        ...

    @property
    def on_track(self) -> bool:
        """Whether its tracking error is within the tube."""
        ...

    def advance(self, until_s: float, schedule: Schedule) -> None:
        """Move to `until_s` of its clock."""
        ...

    def can_reach(self, position: FloatArray, velocity: FloatArray, time_s: float) -> bool:
        """Return whether it may be in this state (d,) [m], [m/s] then, although its reference will not."""
        ...


class UndisturbedVehicle:
    """A vehicle without disturbances, which follows its plans exactly."""

    reference = None
    on_track = True

    def __init__(self, nominal: Plant) -> None:
        self.nominal = nominal

    @property
    def truth(self) -> MotionState:
        """Its true state."""
        return self.nominal.position, self.nominal.velocity

    measured = truth

    def advance(self, until_s: float, schedule: Schedule) -> None:
        """Move to `until_s` of its clock, exactly as planned."""
        self.nominal.advance(until_s, schedule)

    def can_reach(self, position: FloatArray, velocity: FloatArray, time_s: float) -> bool:  # noqa: ARG002
        """Return False: it never deviates from its plan."""
        return False


class TrackingVehicle:
    """A disturbed vehicle, which tracks its reference by feedback.

    Until its first plan it is parked: disturbances do not move it.

    Parameters
    ----------
    nominal : the reference, at its start.
    truth : the true state, (d,) [m], [m/s].
    tracking, weather : its feedback and tube, and its disturbances.
    input_max, speed_max : its limits, as far as it knows them [m/s^2], [m/s].
    """

    def __init__(
        self,
        nominal: Reference,
        truth: MotionState,
        tracking: Tracking,
        weather: AgentDisturbance,
        *,
        input_max: float,
        speed_max: float,
        log: Log | None = None,
    ) -> None:
        self.nominal: Plant = nominal
        self._position, self._velocity = truth
        self._tracking, self._weather, self._log = tracking, weather, log
        self._input_max, self._speed_max = input_max, speed_max
        self._own_max = input_max - tracking.bounds.push_m_per_s2
        self._period_s = tracking.bounds.state_period_s
        self._sample = math.floor((nominal.time_s + SNAP_S) / self._period_s)
        self._measure()

    @property
    def truth(self) -> MotionState:
        """Its true state."""
        return self._position, self._velocity

    @property
    def measured(self) -> MotionState:
        """Its measured state: the velocity exactly, the position with this state period's noise."""
        return self._position + self._noise, self._velocity

    @property
    def reference(self) -> MotionState:
        """The reference state that it tracks."""
        return self.nominal.position, self.nominal.velocity

    @property
    def on_track(self) -> bool:
        """Whether its measured state is within the tube around the reference."""
        return self._tracking.contains(*self._error())

    def advance(self, until_s: float, schedule: Schedule) -> None:
        """Move to `until_s`, measuring at each state period of its clock and switching plans at their starts."""
        while True:
            time_s, before = self.nominal.time_s, self.nominal.position
            self.nominal.advance(time_s, schedule)
            if time_s >= self._sample_s - SNAP_S:
                self._measure()
            elif self.nominal.position is not before:
                self._correct()  # the reference has jumped to another plan
            if time_s >= until_s:
                return
            force, end_s = schedule.hold(time_s, self.nominal.velocity)
            self._move(min(end_s, until_s, self._sample_s), force, schedule)

    def can_reach(self, position: FloatArray, velocity: FloatArray, time_s: float) -> bool:
        """Return whether its limits allow this state (d,) [m], [m/s] then, from the one measured now."""
        measured_position, measured_velocity = self.measured
        dt = max(0.0, time_s - self.nominal.time_s)
        tube, noise = self._tracking.tube, self._tracking.bounds.position_noise_m
        reach = dt * self._speed_max + tube.position_m + 2.0 * noise + self._tracking.start_tolerance
        faster = dt * self._input_max + tube.velocity_m_per_s + self._tracking.start_tolerance
        near = np.linalg.norm(position - measured_position) <= reach
        return bool(near and np.linalg.norm(velocity - measured_velocity) <= faster)

    @property
    def _sample_s(self) -> float:
        """When it measures its state next [s]."""
        return self._sample * self._period_s

    def _measure(self) -> None:
        self._noise, self._gust = self._weather.noise(), self._weather.gust()
        self._sample += 1
        self._correct()

    def _correct(self) -> None:
        gains = self._tracking.gains
        position, velocity = self._error()
        self._feedback = -gains.position * position - gains.velocity * velocity

    def _error(self) -> MotionState:
        position, velocity = self.measured
        return position - self.nominal.position, velocity - self.nominal.velocity

    def _move(self, end_s: float, force: FloatArray, schedule: Schedule) -> None:
        time_s = self.nominal.time_s
        dt = end_s - time_s
        plan = schedule.flying(time_s)
        total = np.zeros_like(force)
        if schedule.flown is not None:
            own = _limited(force + self._feedback, self._own_max)
            total = saturated_acceleration(
                self._velocity, own + self._gust + self._weather.wind, dt, self._weather.speed_max
            )
        if self._log is not None:
            self._log(time_s, self._position, self._velocity, total, plan.ref if plan else None)
        self._position = self._position + dt * self._velocity + 0.5 * dt**2 * total
        self._velocity = self._velocity + dt * total
        self.nominal.advance(end_s, schedule)


def make_vehicle(
    mission: Mission, index: int, time_s: float, seed: int, log: Log | None, place: FloatArray | None = None
) -> Vehicle:
    """Return the vehicle of the mission's agent number `index`, at rest at a place (d,) [m]; left out, at its start."""
    fleet = mission.fleet
    start = fleet.start[index].copy() if place is None else np.array(place, dtype=float)
    rest = np.zeros_like(start)
    if not disturbs_motion(mission.spec.disturbance):
        return UndisturbedVehicle(Plant(time_s, start, rest, log))
    tracking = tracking_of(mission)
    return TrackingVehicle(
        Reference(time_s, start, rest, start_tolerance=tracking.start_tolerance),
        (start.copy(), rest.copy()),
        tracking,
        agent_disturbance(mission, index, seed),
        input_max=float(fleet.input_max[index]),
        speed_max=float(fleet.speed_max[index]),
        log=log,
    )


def _limited(vector: FloatArray, longest: float) -> FloatArray:
    length = float(np.linalg.norm(vector))
    return vector if length <= longest else np.asarray(longest / length * vector)
