"""Checks of the links of a mission (4.19), and of the ends of its plans (3.15)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.mission.config import PlanEnd
from mpc_cover.verification.report import Check, CheckName

if TYPE_CHECKING:
    from mpc_cover.model.fleet_constraints import FleetConstraints
    from mpc_cover.trajectory_file import Recording
    from mpc_cover.verification.path import Path

_PARTS = 16
"""Pieces of an interval in which a parabola is bounded by its control points: 1/256 of its sagitta too far out."""


def check_links(path: Path, fleet: FleetConstraints, tolerance: float) -> Check:
    """Check ||q_i - q_j|| <= rho_C at every instant for every link that must be kept (4.19).

    A piece of a parabola lies in the triangle of its three control points, and a distance is convex: the
    largest of the three bounds the piece from above.
    """
    worst, where = np.inf, ""
    s = np.arange(_PARTS)[:, None, None] / _PARTS
    h = 1.0 / _PARTS
    for one, two in fleet.links:
        a = path.position[:-1, one] - path.position[:-1, two]
        b = (path.velocity[:-1, one] - path.velocity[:-1, two]) * path.step[:, 0]
        c = (path.force[:, one] - path.force[:, two]) * (0.5 * path.step[:, 0] ** 2)
        begin = a + s * (b + s * c)
        slope = b + 2.0 * s * c
        bound = np.maximum(np.linalg.norm(begin, axis=2), np.linalg.norm(begin + 0.5 * h * slope, axis=2))
        bound = np.maximum(bound, np.linalg.norm(begin + h * (slope + h * c), axis=2)).max(axis=0)
        longest = int(np.argmax(bound))
        margin = fleet.communication_range - float(bound[longest])
        if margin < worst:
            worst, where = margin, f"{fleet.ids[one]} - {fleet.ids[two]}, t = {path.time[longest]:.3f} s"
    return Check(CheckName.LINKS, worst >= -tolerance, worst, "m", where)


def check_plan_ends(trajectory: Recording, tolerance: float) -> list[Check]:
    """Check that a plan ends as its mission's `planning.end` asks."""
    mission = trajectory.mission
    planning = mission.spec.planning
    checks = []
    if planning.end is PlanEnd.CLOSED:
        away = np.linalg.norm(trajectory.position[-1] - trajectory.position[0], axis=1)
        faster = np.linalg.norm(trajectory.velocity[-1] - trajectory.velocity[0], axis=1)
        checks += [_smallest(CheckName.CLOSED_POSITION, tolerance - away, "m", mission.fleet.ids)]
        checks += [_smallest(CheckName.CLOSED_VELOCITY, tolerance - faster, "m/s", mission.fleet.ids)]
    if planning.end is PlanEnd.FIXED:
        goal = np.array([agent.end_m for agent in mission.spec.fleet.agents], dtype=float)
        away = np.linalg.norm(trajectory.position[-1] - goal, axis=1)
        checks.append(_smallest(CheckName.END_POSITION, tolerance - away, "m", mission.fleet.ids))
    return checks


def _smallest(name: CheckName, margin: np.ndarray, unit: str, ids: tuple[str, ...]) -> Check:
    worst = int(np.argmin(margin))
    return Check(name, bool(margin[worst] >= 0.0), float(margin[worst]), unit, ids[worst])
