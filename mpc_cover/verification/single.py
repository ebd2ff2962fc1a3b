"""Verification of single integrators (5.1), whose velocity is their input and may jump from sample to sample."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.verification.report import Check, CheckName, Report

if TYPE_CHECKING:
    from mpc_cover.trajectory_file import Recording

_NOT_APPLICABLE = frozenset(
    {CheckName.DYNAMICS_VELOCITY, CheckName.VELOCITY_SUM, CheckName.START_VELOCITY, CheckName.REST, CheckName.INPUT},
)


def as_single(report: Report, trajectory: Recording) -> Report:
    """Return the report of double integrators without the checks that do not apply to single integrators.

    Their velocity is that of the interval that follows and bounded as a speed (5.2); a force has nothing to act on, so
    that every path between two samples must be straight.
    """
    kept = [check for check in report.checks if check.name not in _NOT_APPLICABLE]
    if not report.checks[0].holds:
        return Report(tuple(kept))
    largest = float(np.abs(trajectory.input).max(initial=0.0))
    none = Check(CheckName.NO_INPUT, largest == 0.0, -largest, "m/s^2", "single integrators take none")
    return Report((*kept, none))
