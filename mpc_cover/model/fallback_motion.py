"""What is flown when there is no new plan: the shifted plan, or the brake."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.motion import roll_out
from mpc_cover.model.trajectory import Plan

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.fleet import Fleet


class PlanSource(Enum):
    """The ladder: what a step came out with, best first."""

    NEW = "a verified new plan"
    SHIFTED = "the previous plan, shifted"
    BRAKE = "braking to rest"
    REST = "at rest, nothing to do"


def shifted_plan(plan: Plan, position: FloatArray, velocity: FloatArray, start_time: float) -> Plan:
    """Return what is left of `plan` from `start_time` on, from the (m, d) state there, with rest at the end.

    The velocities are those planned; a start that differs a little moves the rest of the path in parallel.
    """
    done = round((start_time - plan.start_time) / plan.period)
    left = plan.velocity[min(max(done, 0), plan.steps) :]
    padded = np.zeros_like(plan.velocity)
    padded[: left.shape[0]] = left
    padded[-1] = 0.0
    return plan_from_velocities(position, velocity, padded[1:], start_time, plan.period)


def plan_from_velocities(
    position: FloatArray, velocity: FloatArray, later: FloatArray, start_time: float, period: float
) -> Plan:
    """Return the plan with velocities `later` (N, m, d) [m/s] at samples 1 to N."""
    velocities = np.concatenate([velocity[None], later])
    force = np.diff(velocities, axis=0) / period
    positions, _ = roll_out(position, velocity, force, period)
    return Plan(start_time, period, positions, velocities, force)


def brake(velocity: FloatArray, fleet: Fleet, period: float) -> FloatArray:
    """Return (B, m, d) velocities [m/s] at samples 1 to B of the hardest straight braking from (m, d); B >= 1."""
    speed = np.linalg.norm(velocity, axis=1)
    slower = fleet.input_max * period * (1.0 - 1e-9)
    count = max(1, int(np.ceil((speed / slower).max() - 1e-9)))
    share = np.maximum(speed[None] - np.arange(1, count + 1)[:, None] * slower[None], 0.0)
    share /= np.maximum(speed, 1e-12)[None]
    share[-1] = 0.0
    return np.asarray(share[:, :, None] * velocity[None])


def brake_plan(
    position: FloatArray, velocity: FloatArray, fleet: Fleet, start_time: float, period: float, steps: int
) -> Plan:
    """Return the plan that brakes as hard as it may and then stays, `steps` samples or as many as it takes."""
    braking = brake(velocity, fleet, period)
    rest = np.zeros((max(0, steps - braking.shape[0]), *velocity.shape))
    return plan_from_velocities(position, velocity, np.concatenate([braking, rest]), start_time, period)
