"""Small flights for tests, propagated here: rest to rest along straight legs, all agents in step."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.mission.load import Mission, build_mission, load_mission
from mpc_cover.model.fleet_constraints import FleetConstraints
from mpc_cover.trajectory_file import Recording

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray


def fleet_of(start: FloatArray, **changes: Any) -> FleetConstraints:
    """Return box-3's limits for another fleet: (m, d) start [m], in a wide box, with neither rho_B nor rho_C."""
    agents, dimension = start.shape
    fleet = FleetConstraints.of(
        load_mission("box-3").fleet,
        ids=tuple(f"a{i + 1}" for i in range(agents)),
        start=start,
        input_max=np.full(agents, 1.5),
        speed_max=np.full(agents, 1.5),
        radius=np.ones((agents, 1)),
        separation_min=0.0,
        communication_range=np.inf,
        motion_min=np.full(dimension, -100.0),
        motion_max=np.full(dimension, 100.0),
    )
    return replace(fleet, **changes)


def propagate(
    start: FloatArray, force: FloatArray, time: FloatArray, velocity: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return position and velocity (T, m, d) under inputs (T-1, m, d), sample by sample."""
    position = [np.asarray(start, dtype=float)]
    speed = [np.zeros_like(position[0]) if velocity is None else np.asarray(velocity, dtype=float)]
    for step, u in zip(np.diff(time), force, strict=True):
        position.append(position[-1] + step * speed[-1] + 0.5 * step**2 * u)
        speed.append(speed[-1] + step * u)
    return np.array(position), np.array(speed)


def leg(displacement: FloatArray, period: float, ramp: int, coast: int) -> FloatArray:
    """Return inputs (2 ramp + coast, m, d) that move a fleet at rest by (m, d) [m], back to rest."""
    push = np.asarray(displacement, dtype=float) / (period**2 * ramp * (ramp + coast))
    parts = [np.repeat(sign * push[None], count, axis=0) for sign, count in ((1, ramp), (0, coast), (-1, ramp))]
    return np.concatenate(parts)


def covered_at(time: FloatArray, position: FloatArray, mission: Mission) -> FloatArray:
    """Return (K,) [s] when every magnitude was measured, by brute force."""
    distance = np.linalg.norm(position[:, :, None] - mission.field.cell, axis=3)
    seen = (distance[..., None] <= mission.fleet.radius[:, None] + 1e-9).any(axis=1)
    first = np.where(seen.any(axis=0), time[np.argmax(seen, axis=0)], np.inf)
    return first.max(axis=1)


def trajectory_of(mission: Mission, force: FloatArray, kind: str = "simulate") -> Recording:
    """Return the record of a flight from the mission's start under inputs (N, m, d), one a period."""
    time = mission.spec.control.period_s * np.arange(len(force) + 1)
    position, velocity = propagate(mission.fleet.start, force, time)
    return Recording(
        time=time,
        position=position,
        velocity=velocity,
        input=force,
        cell=mission.field.cell,
        covered_at=covered_at(time, position, mission),
        agent_id=mission.fleet.ids,
        mission=mission,
        meta={"kind": kind, "version": "0.1.0", "seed": 0, "backend": "none"},
    )


def box3_flight(kind: str = "simulate") -> Recording:
    """Return a boustrophedon of three abreast over box-3: within every limit, connected, 98 % covered."""
    mission = load_mission("box-3")
    period = mission.spec.control.period_s
    abreast = np.array([[1.0, 1.0], [1.0, 2.7], [1.0, 4.4]]) - mission.fleet.start
    across, up = np.array([8.0, 0.0]), np.array([0.0, 4.6])
    legs = [
        leg(abreast, period, 2, 4),
        leg(np.tile(across, (3, 1)), period, 2, 10),
        leg(np.tile(up, (3, 1)), period, 2, 5),
        leg(np.tile(-across, (3, 1)), period, 2, 10),
    ]
    return trajectory_of(mission, np.concatenate(legs), kind)


def mission_of(raw: dict[str, Any], **area: Any) -> Mission:
    """Return a mission from raw data, with changes to its area."""
    return build_mission({**raw, "area": {**raw["area"], **area}}, "test")


def random_walk(mission: Mission, steps: int, seed: int = 0, gain: float = 0.6) -> Recording:
    """Return a flight that wanders about its start: for pictures, with no care for limits."""
    rng = np.random.default_rng(seed)
    force = np.zeros((steps, mission.fleet.size, mission.fleet.dimension))
    bound = gain * mission.fleet.input_max[:, None]
    position, velocity = mission.fleet.start.copy(), np.zeros_like(mission.fleet.start)
    middle = 0.5 * (mission.fleet.motion_min + mission.fleet.motion_max)
    period = mission.spec.control.period_s
    for k in range(steps):
        pull = 0.15 * (middle - position) - 0.4 * velocity + rng.normal(size=position.shape)
        force[k] = np.clip(pull, -bound, bound)
        position += period * velocity + 0.5 * period**2 * force[k]
        velocity += period * force[k]
    return trajectory_of(mission, force)
