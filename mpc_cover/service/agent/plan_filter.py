"""The agent's own filter of plans, independent of who sent them.

A plan must be finite and of the right shape (`decoding`), addressed to this process of the agent, from the newest
controller, within the agent's limits, consistent with its dynamics, and at rest at its end. It must start in the
state that the agent predicts for itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.motion import roll_out
from mpc_cover.model.tube import start_tolerance
from mpc_cover.service.protocol.decoding import Reason, RejectedError

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.service.protocol.messages import PlanMessage

LIMIT_TOLERANCE = 1e-6
"""Relative to a speed or input limit; in sensing radii for the fence."""
DYNAMICS_TOLERANCE = 1e-6
"""Between the plan's samples and the roll-out of its inputs, in sensing radii, and those a second."""
REST_TOLERANCE = 1e-3
"""Speed at the end of a plan, from which the agent brakes, relative to its limit."""
EPOCH_JUMP = 10**6
"""A new controller's epoch is at most so far ahead of the last one's: whoever sends a plan of the highest number that
there is must not turn an agent away from all controllers to come. Of its first controller it takes any. Plain choice:
a million restarts."""
_ROUNDING = 16.0
"""Rounding errors of coordinates that are tolerated, in units of their last digit; a plain choice."""


@dataclass(frozen=True, eq=False)
class Limits:
    """One agent's limits.

    Attributes
    ----------
    input_max, speed_max : [m/s^2], [m/s].
    motion_min, motion_max : the box (d,) [m] that it stays in.
    length : the fleet's smallest sensing radius [m], to which tolerances are relative.
    start_tolerance : of the start of a plan [m], [m/s].
    """

    input_max: float
    speed_max: float
    motion_min: FloatArray
    motion_max: FloatArray
    length: float
    start_tolerance: float

    @property
    def rounding(self) -> float:
        """Rounding errors of positions [m]: large far from the origin."""
        return _ROUNDING * float(np.spacing(np.abs([self.motion_min, self.motion_max]).max()))


def limits_of(mission: Mission, index: int) -> Limits:
    """Return the limits of the mission's agent number `index`."""
    fleet = mission.fleet
    return Limits(
        float(fleet.input_max[index]),
        float(fleet.speed_max[index]),
        fleet.motion_min,
        fleet.motion_max,
        fleet.sensing_radius_min,
        start_tolerance(fleet),
    )


@dataclass
class Authority:
    """The newest controller; plans of older epochs, and of another controller of the same epoch, are rejected."""

    epoch: int = -1
    controller: str = ""
    seq: int = -1

    def check(self, message: PlanMessage) -> None:
        """Raise RejectedError for an old epoch or one too far ahead, another controller of this one, or an old plan."""
        if message.epoch > self.epoch + EPOCH_JUMP and self.epoch >= 0:
            raise RejectedError(Reason.FAR_EPOCH, f"{message.epoch}, seen {self.epoch}")
        if message.epoch < self.epoch:
            raise RejectedError(Reason.OLD_EPOCH, f"{message.epoch}, seen {self.epoch}")
        if message.epoch > self.epoch:
            return
        if message.controller != self.controller:
            raise RejectedError(Reason.OTHER_CONTROLLER, f"{message.controller}, epoch {self.epoch} is another's")
        if message.seq <= self.seq:
            raise RejectedError(Reason.OLD, f"plan {message.seq}, seen {self.seq}")

    def accept(self, message: PlanMessage) -> None:
        """Note the controller of a plan that passed every check."""
        self.epoch, self.controller, self.seq = message.epoch, message.controller, message.seq


def check_content(plan: Trajectory, limits: Limits) -> None:
    """Check limits, fence, dynamics and rest.

    Raises
    ------
    RejectedError
        With the first reason found.
    """
    _check_norm(plan.input, limits.input_max, "input")
    _check_norm(plan.velocity, limits.speed_max, "speed")
    outside = np.maximum(limits.motion_min - plan.position, plan.position - limits.motion_max).max()
    if outside > LIMIT_TOLERANCE * limits.length + limits.rounding:
        raise RejectedError(Reason.FENCE, f"{outside:.3g} m outside")
    position, velocity = roll_out(
        plan.position[:1], plan.velocity[:1], plan.input[:, None, :], plan.period
    )  # one agent: (N+1, 1, d)
    error = max(_gap(position[:, 0], plan.position), _gap(velocity[:, 0], plan.velocity))
    if not error <= DYNAMICS_TOLERANCE * limits.length + limits.rounding:
        raise RejectedError(Reason.DYNAMICS, f"off by {error:.3g}")
    speed = float(np.linalg.norm(plan.velocity[-1]))
    if speed > REST_TOLERANCE * limits.speed_max:
        raise RejectedError(Reason.NOT_AT_REST, f"{speed:.3g} m/s")


def check_time(message: PlanMessage, now_s: float) -> None:
    """Raise RejectedError when the plan should have been received before `now_s`."""
    if now_s > message.valid_until_s:
        raise RejectedError(Reason.EXPIRED, f"{now_s - message.valid_until_s:.3g} s ago")


def check_start(planned: tuple[FloatArray, FloatArray], own: tuple[FloatArray, FloatArray], tolerance: float) -> None:
    """Raise RejectedError when position or velocity (d,) differ from the agent's own at that instant."""
    error = max(_gap(planned[0], own[0]), _gap(planned[1], own[1]))
    if not error <= tolerance:
        raise RejectedError(Reason.START, f"off by {error:.3g}")


def _check_norm(vectors: FloatArray, limit: float, what: str) -> None:
    largest = float(np.linalg.norm(vectors, axis=1).max(initial=0.0))
    if largest > limit * (1.0 + LIMIT_TOLERANCE):
        raise RejectedError(Reason.LIMITS, f"{what} {largest:.6g} above {limit:g}")


def _gap(first: FloatArray, second: FloatArray) -> float:
    return float(np.abs(first - second).max(initial=0.0))
