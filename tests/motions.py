"""Random motions and windows for tests of coverage, constraints and planning."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from flights import fleet_of

from mpc_cover.constraints.boundary import BoundaryConditions
from mpc_cover.coverage.majoriser import Softness
from mpc_cover.model.motion import roll_out
from mpc_cover.planning.budget import Budget
from mpc_cover.planning.initial_guess.waypoint_tracking import track_waypoints
from mpc_cover.planning.ocp import OCP, Settings

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray

PERIOD = 0.5
UNLIMITED, EXHAUSTED = Budget.unlimited(), Budget.counted(0.0)


def random_motion(
    rng: np.random.Generator, steps: int, agents: int, dimension: int = 2
) -> tuple[FloatArray, FloatArray]:
    """Return positions and velocities (N+1, m, d) under random inputs up to 1 m/s^2 per axis."""
    start = rng.uniform(2.0, 8.0, (agents, dimension))
    speed = rng.uniform(-0.5, 0.5, (agents, dimension))
    return roll_out(start, speed, rng.uniform(-1.0, 1.0, (steps, agents, dimension)), PERIOD)


def grid(size: int, spacing: float = 1.0, dimension: int = 2) -> FloatArray:
    """Return the centroids of size^d cells."""
    axis = (np.arange(size) + 0.5) * spacing
    return np.stack(np.meshgrid(*[axis] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)


def random_window(seed: int, steps: int = 6, agents: int = 3, dimension: int = 2) -> tuple[OCP, FloatArray]:
    """Return a window of a connected, separated fleet at rest, and a feasible decision vector."""
    rng = np.random.default_rng(seed)
    while True:
        start = rng.uniform(1.0, 7.0, (agents, dimension))
        apart = np.linalg.norm(start[:, None] - start[None], axis=2)[np.triu_indices(agents, 1)]
        if apart.min(initial=np.inf) > 0.8 and apart.max(initial=0.0) < 4.0:
            break
    fleet = fleet_of(
        start,
        separation_min=0.5,
        communication_range=4.5,
        motion_min=np.zeros(dimension),
        motion_max=np.full(dimension, 8.0),
    )
    cell = grid(8 if dimension == 2 else 4, 1.0 if dimension == 2 else 2.0, dimension)
    weight = rng.uniform(0.2, 2.0, (1, cell.shape[0]))
    shift = rng.uniform(-1.0, 1.0, dimension)
    goals = [np.clip(q + shift, 0.5, 7.5)[None] for q in start]
    still = np.zeros_like(start)
    flight = track_waypoints(goals, start, still, fleet, PERIOD, steps=steps)
    ends = BoundaryConditions(start_position=start, start_velocity=still, end_velocity=still)
    ocp = OCP(fleet, cell, weight, steps, PERIOD, ends)
    return ocp, ocp.decision(flight.position[0], flight.velocity)


def settings(beta: float = 4.0, margin: float = 0.1) -> Settings:
    """Return settings of a middling stage."""
    return Settings(Softness(beta, margin))


__all__ = ["EXHAUSTED", "PERIOD", "UNLIMITED", "grid", "random_motion", "random_window", "replace", "settings"]
