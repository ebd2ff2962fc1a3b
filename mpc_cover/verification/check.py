"""Verifies a trajectory file: the motion, and the coverage it claims."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.mission.config import Dynamics, PlanEnd, PlanStart
from mpc_cover.trajectory_file import RecordingKind
from mpc_cover.verification.ages import check_ages
from mpc_cover.verification.coverage_claim import check_coverage
from mpc_cover.verification.ends import check_plan_ends
from mpc_cover.verification.judged import judged_by
from mpc_cover.verification.loss_evidence import check_losses
from mpc_cover.verification.losses import losses_of, verify_with_losses
from mpc_cover.verification.motion import verify_motion
from mpc_cover.verification.path import Path
from mpc_cover.verification.report import Check, CheckName, Report
from mpc_cover.verification.residual_sums import check_residual_sums
from mpc_cover.verification.resolution import resolution_of
from mpc_cover.verification.seal_check import check_seal
from mpc_cover.verification.single import as_single
from mpc_cover.verification.tolerance import tolerance_of

if TYPE_CHECKING:
    from mpc_cover.mission.load import Mission
    from mpc_cover.trajectory_file import Recording
    from mpc_cover.verification.resolution import Resolution


def check_trajectory(trajectory: Recording, mission: Mission | None = None) -> Report:
    """Verify a trajectory against a mission, or where none is given, against the one that it carries.

    The motion starts in the mission's start at rest; a plan (meta["kind"]) starts and ends as the
    mission's `planning` asks. After the loss of agents (meta["lost"]), of which their motion must be evidence, the
    others must stay connected without them. The coverage is recomputed from the positions at the samples, and so are
    the ages of a strict patrol's looks. What rounding to single precision does to a copy is nobody's fault.

    Raises
    ------
    UserError
        The mission is not of the trajectory's agents; see `judged_by`.
    """
    sealed = [] if (seal := check_seal(trajectory)) is None else [seal]
    trajectory = judged_by(trajectory, mission) if mission is not None else trajectory
    motion, resolution = _verify_motion(trajectory)
    if not motion.checks[0].holds:
        unseen = Check(CheckName.COVERAGE, holds=False, margin=-np.inf, unit="s", where="not looked at")
        return Report((*motion.checks, unseen))
    planned = trajectory.meta.get("kind") == RecordingKind.PLAN
    ends = check_plan_ends(trajectory, tolerance_of(trajectory.mission.fleet) + resolution.length) if planned else []
    coverage = check_coverage(trajectory, resolution)
    ages = check_ages(trajectory, resolution) if coverage[0].holds else []
    return Report((*motion.checks, *ends, *coverage, *ages, *sealed))


def _verify_motion(trajectory: Recording) -> tuple[Report, Resolution]:
    """Return what holds of the motion, and what rounding may have done to it."""
    fleet, planning = trajectory.mission.fleet, trajectory.mission.spec.planning
    planned = trajectory.meta.get("kind") == RecordingKind.PLAN
    free = planned and planning.start is PlanStart.FREE
    arrays = trajectory.time, trajectory.position, trajectory.velocity, trajectory.input
    start = (fleet.start, np.zeros_like(fleet.start))
    resolution = resolution_of(trajectory)
    tolerance = tolerance_of(fleet) + resolution.length
    if losses := losses_of(trajectory):
        motion = verify_with_losses(trajectory, losses, tolerance=tolerance, start=start)
    else:
        at_rest = planned and planning.end in {PlanEnd.REST, PlanEnd.FIXED}
        motion = verify_motion(fleet, *arrays, tolerance=tolerance, at_rest=at_rest, start=None if free else start)
    if motion.checks[0].holds:
        sums = check_residual_sums(Path(*arrays), fleet.ids, tolerance_of(fleet), resolution)
        lost = [check_losses(trajectory, losses, tolerance, time_s=resolution.time_s)] if losses else []
        motion = Report((*motion.checks[:3], *sums, *motion.checks[3:], *lost))
    if trajectory.mission.spec.fleet.dynamics is Dynamics.SINGLE:
        motion = as_single(motion, trajectory)
    return motion, resolution
