"""Verifies a trajectory file: the motion, and the coverage it claims."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.mission.config import Dynamics, PlanEnd, PlanStart
from mpc_cover.trajectory_file import RecordingKind
from mpc_cover.verification.ages import check_ages
from mpc_cover.verification.coverage_claim import check_coverage
from mpc_cover.verification.ends import check_plan_ends
from mpc_cover.verification.losses import losses_of, verify_with_losses
from mpc_cover.verification.motion import verify_motion
from mpc_cover.verification.report import Check, CheckName, Report
from mpc_cover.verification.single import as_single
from mpc_cover.verification.tolerance import tolerance_of

if TYPE_CHECKING:
    from mpc_cover.trajectory_file import Recording


def check_trajectory(trajectory: Recording) -> Report:
    """Verify a trajectory against the mission it carries.

    The motion starts in the mission's start at rest; a plan (meta["kind"]) starts and ends as the
    mission's `planning` asks. After the loss of agents (meta["lost"]) the others must stay connected without
    them. The coverage is recomputed from the positions at the samples, and so are the ages of a strict patrol's looks.
    """
    fleet, planning = trajectory.mission.fleet, trajectory.mission.spec.planning
    tolerance = tolerance_of(fleet)
    planned = trajectory.meta.get("kind") == RecordingKind.PLAN
    free = planned and planning.start is PlanStart.FREE
    start = (fleet.start, np.zeros_like(fleet.start))
    if (losses := losses_of(trajectory)) and not planned:
        motion = verify_with_losses(trajectory, losses, tolerance=tolerance, start=start)
    else:
        motion = verify_motion(
            fleet,
            trajectory.time,
            trajectory.position,
            trajectory.velocity,
            trajectory.input,
            tolerance=tolerance,
            at_rest=planned and planning.end in {PlanEnd.REST, PlanEnd.FIXED},
            start=None if free else start,
        )
    if trajectory.mission.spec.fleet.dynamics is Dynamics.SINGLE:
        motion = as_single(motion, trajectory)
    if not motion.checks[0].holds:
        unseen = Check(CheckName.COVERAGE, holds=False, margin=-np.inf, unit="s", where="not looked at")
        return Report((*motion.checks, unseen))
    ends = check_plan_ends(trajectory, tolerance) if planned else []
    coverage = check_coverage(trajectory)
    return Report((*motion.checks, *ends, *coverage, *(check_ages(trajectory) if coverage[0].holds else [])))
