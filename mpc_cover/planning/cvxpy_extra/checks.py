"""A user's constraints as lines of a verification report."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from mpc_cover.planning.cvxpy_extra.evaluation import evaluate
from mpc_cover.verification.report import Check, Report

if TYPE_CHECKING:
    from mpc_cover.planning.cvxpy_extra.extra import Extra
    from mpc_cover.trajectory_file import Recording

_LINES = 8
"""Constraints that have a line each; of more, those that hold share one. A plain choice: half of the verifier's own."""


def with_extra(report: Report, recording: Recording, extra: Extra | None) -> Report:
    """Return the report with a line for each constraint of the user's, judged at the samples of a recording.

    Raises
    ------
    UserError
        As `evaluation.evaluate`.
    """
    return report if extra is None else Report((*report.checks, *check_extra(recording, extra)))


def check_extra(recording: Recording, extra: Extra) -> tuple[Check, ...]:
    """Return a line for each constraint, or group of them, that the user's function returns for a recording."""
    judged = evaluate(extra, recording.plain(), recording.mission).groups
    short = extra.name.partition(":")[2]
    lines = [Check(f"{short} {one.name}", one.holds, one.margin, "", one.where) for one in judged]
    if len(lines) <= _LINES:
        return tuple(lines)
    kept = [line for line in lines if line.holds]
    least = min((line.margin for line in kept), default=math.inf)
    shared = Check(short, holds=True, margin=least, unit="", where=f"{len(kept)} constraints")
    return tuple(line for line in lines if not line.holds)[:_LINES] + ((shared,) if kept else ())
