"""The verdict on a solver's result: the exact J (4.34), the coverage, and the independent verifier's checks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.pairs import all_pairs, linked_pairs
from mpc_cover.coverage.nearest import nearest_samples
from mpc_cover.mission.config import PlanEnd
from mpc_cover.trajectory_file import Recording
from mpc_cover.verification.connectivity import bottleneck
from mpc_cover.verification.ends import check_plan_ends
from mpc_cover.verification.motion import verify_motion
from mpc_cover.verification.report import CheckName

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.studies.case import Case
    from mpc_cover.verification.report import Check

TOLERANCE = 1e-4
"""Tolerance of all limits [m, m/s, m/s^2]: general solvers stop at about 1e-6 of squared limits."""

_TIE = 1e-9
"""A cell at distance exactly rho is covered, in spite of rounding [m]."""
_BETWEEN = frozenset({CheckName.BOX, CheckName.SEPARATION, CheckName.CONNECTIVITY, CheckName.LINKS})
"""Checks that the verifier also makes between the samples."""


@dataclass(frozen=True)
class Verdict:
    """One motion, judged. Violations are 0 where nothing is violated.

    Attributes
    ----------
    cost : J (4.34), with the hard minimum and no margin [m].
    covered_percent : of the cells that matter, all their magnitudes measured at samples.
    sampled : worst violation when box and pairs are looked at only at the samples, as (4.15) to (4.20) are written.
    path : worst violation along the continuous path: all the verifier's checks.
    separation_sampled, separation_path : smallest distance less rho_B [m]; None where it is not asked for.
    worst : what is violated most along the path, in the verifier's words; empty when everything holds.
    """

    cost: float
    covered_percent: float
    sampled: float
    path: float
    separation_sampled: float | None
    separation_path: float | None
    worst: str

    @property
    def holds_sampled(self) -> bool:
        """Whether everything holds at the samples: what the NLP asks for."""
        return self.sampled <= TOLERANCE

    @property
    def holds(self) -> bool:
        """Whether everything holds along the continuous path: what can be flown."""
        return self.path <= TOLERANCE

    @property
    def complete(self) -> bool:
        """Whether no better result is possible."""
        return self.holds and self.covered_percent == 100.0  # noqa: PLR2004 - all of it


def judge(case: Case, x: FloatArray) -> Verdict:
    """Judge a decision vector; one with numbers that are not finite violates everything infinitely."""
    if not np.isfinite(x).all():
        return Verdict(np.inf, 0.0, np.inf, np.inf, None, None, "numbers: not finite")
    position, velocity = case.ocp.motion(x)
    checks = _checks(case, position, velocity)
    cost, covered = _coverage(case, position)
    apart, others = _slack_at_samples(case, position)
    alone = [check.margin for check in checks if check.name not in _BETWEEN]
    worst = min(checks, key=lambda check: check.margin)
    return Verdict(
        cost=cost,
        covered_percent=covered,
        sampled=max(0.0, -min(*alone, others, np.inf if apart is None else apart)),
        path=max(0.0, -worst.margin),
        separation_sampled=apart,
        separation_path=next((check.margin for check in checks if check.name is CheckName.SEPARATION), None),
        worst="" if worst.margin >= -TOLERANCE else f"{worst.name} {worst.margin:.2g} {worst.unit} ({worst.where})",
    )


def _checks(case: Case, position: FloatArray, velocity: FloatArray) -> list[Check]:
    """Return the verifier's checks of a motion (N+1, m, d), with those of the ends that the mission asks for."""
    mission, ends = case.mission, case.ocp.ends
    given = ends.start_position is not None and ends.start_velocity is not None
    force = np.diff(velocity, axis=0) / case.ocp.period
    report = verify_motion(
        mission.fleet,
        case.time(),
        position,
        velocity,
        force,
        tolerance=TOLERANCE,
        at_rest=mission.spec.planning.end in {PlanEnd.REST, PlanEnd.FIXED},
        start=(mission.fleet.start, np.zeros_like(mission.fleet.start)) if given else None,
    )
    unknown = np.full(mission.field.size, np.inf)
    ids, cell = mission.fleet.ids, mission.field.cell
    trajectory = Recording(
        case.time(),
        position,
        velocity,
        force,
        cell=cell,
        covered_at=unknown,
        agent_id=ids,
        mission=mission,
    )
    return [*report.checks, *check_plan_ends(trajectory, TOLERANCE)]


def _coverage(case: Case, position: FloatArray) -> tuple[float, float]:
    """Return J (4.34) [m], and the percentage of cells with a positive weight that are covered."""
    ocp = case.ocp
    nearest = nearest_samples(position, ocp.cell, ocp.fleet.radius, ocp.weight, 1, ocp.looks)
    excess = nearest.excess[:, 0]
    left = np.zeros(ocp.cell.shape[0], dtype=bool)
    left[nearest.cell[excess > _TIE]] = True
    matters = (ocp.weight > 0.0).any(axis=0)
    covered = int(matters.sum() - left.sum())
    percent = 100.0 * covered / max(int(matters.sum()), 1)
    return float(nearest.weight @ np.maximum(excess, 0.0)), percent if left.any() else 100.0


def _slack_at_samples(case: Case, position: FloatArray) -> tuple[float | None, float]:
    """Return the slack [m] of the separation, None where it is not asked for, and of box, connectivity and links."""
    fleet = case.mission.fleet
    others = [float(np.minimum(position - fleet.motion_min, fleet.motion_max - position).min())]
    if fleet.size == 1:
        return None, others[0]
    one, two = all_pairs(fleet.size)
    length = np.linalg.norm(position[:, one] - position[:, two], axis=2)
    if np.isfinite(fleet.communication_range):
        others.append(fleet.communication_range - float(bottleneck(length, fleet.size).max()))
        linked = length[:, linked_pairs(fleet.size, fleet.links)]
        others.append(fleet.communication_range - float(linked.max(initial=0.0)))
    apart = float(length.min()) - fleet.separation_min if fleet.separation_min > 0.0 else None
    return apart, min(others)
