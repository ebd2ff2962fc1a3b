"""What is asked of single integrators (5.1), whose velocity is their input and may jump from sample to sample."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.verification.report import Check, Report

if TYPE_CHECKING:
    from mpc_cover.trajectory_file import Recording

_NOT_ASKED = ("dynamics of velocity", "start velocity", "rest at the end")


def as_single(report: Report, trajectory: Recording) -> Report:
    """Return a double integrators' report without what single integrators need not keep.

    Their velocity is that of the interval that follows and bounded as a speed (5.2); a force has nothing to act on, so
    that every path between two samples must be straight.
    """
    kept = [check for check in report.checks if check.name not in _NOT_ASKED and check.name != "input"]
    if not report.checks[0].holds:
        return Report(tuple(kept))
    largest = float(np.abs(trajectory.input).max(initial=0.0))
    return Report((*kept, Check("no input", largest == 0.0, -largest, "m/s^2", "single integrators take none")))
