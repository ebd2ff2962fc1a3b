"""What a result is worth: J (4.34) exactly, what is covered, and what the independent verifier finds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.coverage.nearest import nearest_samples
from mpc_cover.verification.connectivity import bottleneck
from mpc_cover.verification.ends import check_plan_ends
from mpc_cover.verification.motion import verify_motion

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.studies.case import Case
    from mpc_cover.verification.report import Report

TOLERANCE = 1e-4
"""What anyone may exceed a limit by [m, m/s, m/s^2]: general solvers stop at about 1e-6 of squared limits."""

_TIE = 1e-9
"""A cell at distance exactly rho is covered, whatever the last bit says [m]."""


@dataclass(frozen=True)
class Verdict:
    """One motion, judged. Violations are 0 where nothing is violated.

    Attributes
    ----------
    cost : J (4.34), with the hard minimum and no margin [m].
    covered_percent : of the cells that matter, all their magnitudes measured at samples.
    sampled : worst violation when the pairs are looked at only at the samples, as (4.18) to (4.20) are written.
    path : worst violation along the continuous path, all the verifier's checks.
    separation_sampled, separation_path : smallest distance less rho_B [m]; None where it is not asked for.
    worst : the check with the smallest margin along the path, in the verifier's words.
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
        """Whether everything holds at the samples: what a peer's NLP asks for."""
        return self.sampled <= TOLERANCE

    @property
    def holds(self) -> bool:
        """Whether everything holds along the continuous path: what can be flown."""
        return self.path <= TOLERANCE

    @property
    def complete(self) -> bool:
        """Whether there is nothing left to be gained."""
        return self.holds and self.covered_percent == 100.0  # noqa: PLR2004 - all of it


def judge(case: Case, x: FloatArray) -> Verdict:
    """Judge a decision vector; one with numbers that are not finite violates everything infinitely."""
    if not np.isfinite(x).all():
        return Verdict(np.inf, 0.0, np.inf, np.inf, None, None, "numbers: not finite")
    fleet, window = case.mission.fleet, case.window
    position, velocity = window.motion(x)
    report = _report(case, position, velocity, pairs=True)
    cost, covered = _coverage(case, position)
    apart, linked = _pairs_at_samples(case, position)
    alone = _report(case, position, velocity, pairs=False)
    path_margin = next((check.margin for check in report.checks if check.name == "separation"), None)
    worst = min(report.checks, key=lambda check: check.margin)
    return Verdict(
        cost=cost,
        covered_percent=covered,
        sampled=max(_violation(alone), -apart, -linked, 0.0),
        path=_violation(report),
        separation_sampled=apart if fleet.size > 1 and fleet.separation_min > 0.0 else None,
        separation_path=path_margin,
        worst=str(worst),
    )


def _violation(report: Report) -> float:
    return max(0.0, *(-check.margin for check in report.checks))


def _report(case: Case, position: FloatArray, velocity: FloatArray, *, pairs: bool) -> Report:
    """Verify a motion (N+1, m, d) with or without what ties pairs together between the samples."""
    fleet, ends = case.mission.fleet, case.window.ends
    if not pairs:
        fleet = replace(fleet, separation_min=0.0, communication_range=np.inf, links=())
    start = None
    if ends.start_position is not None and ends.start_velocity is not None:
        start = (ends.start_position, ends.start_velocity)
    force = np.diff(velocity, axis=0) / case.window.period
    planning = case.mission.spec.planning
    report = verify_motion(
        fleet,
        case.time(),
        position,
        velocity,
        force,
        tolerance=TOLERANCE,
        at_rest=planning.end in {"rest", "fixed"},
        start=start,
    )
    return report
