"""Verifying a motion during which agents are lost: from then on the others must stay connected without them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.verification.motion import verify_motion
from mpc_cover.verification.report import Check, Report

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.trajectory import Trajectory


def losses_of(trajectory: Trajectory) -> dict[int, float]:
    """Return {agent index: time of its loss [s]} from the file's meta; what is unreadable counts for nothing."""
    lost: Any = trajectory.meta.get("lost")
    if not isinstance(lost, dict):
        return {}
    ids = trajectory.mission.fleet.ids
    times = {ids.index(name): time for name, time in lost.items() if name in ids and isinstance(time, (int, float))}
    return {index: float(time) for index, time in times.items() if np.isfinite(time)}


def verify_with_losses(
    trajectory: Trajectory, losses: dict[int, float], *, tolerance: float, start: tuple[FloatArray, FloatArray]
) -> Report:
    """Verify stretch by stretch, each with those who are left; the smallest margin of each property is reported.

    A lost agent remains an obstacle, and its own motion must still obey dynamics and limits.
    """
    reports = []
    for first, last, fleet in _stretches(trajectory, losses):
        part = slice(first, last + 1)
        reports.append(
            verify_motion(
                fleet,
                trajectory.time[part],
                trajectory.position[part],
                trajectory.velocity[part],
                trajectory.input[first:last],
                tolerance=tolerance,
                start=start if first == 0 else None,
            )
        )
    worst: dict[str, Check] = {}
    for check in (check for report in reports for check in report.checks):
        if check.name not in worst or check.margin < worst[check.name].margin:
            worst[check.name] = check
    return Report(tuple(worst.values()))


def _stretches(trajectory: Trajectory, losses: dict[int, float]) -> Iterator[tuple[int, int, Fleet]]:
    """Yield (first sample, last sample, fleet) between losses; whom an interval loses is lost from its start."""
    fleet, end = trajectory.mission.fleet, len(trajectory.time) - 1
    cuts = {0, end}
    begins = {i: max(0, int(np.searchsorted(trajectory.time, t, side="right")) - 1) for i, t in losses.items()}
    cuts |= {min(begin, end) for begin in begins.values()}
    ordered = sorted(cuts)
    for first, last in pairwise(ordered):
        lost = tuple(sorted(i for i, begin in begins.items() if begin <= first))
        links = tuple(link for link in fleet.links if not set(link) & set(lost))
        yield first, last, replace(fleet, lost=lost, links=links)
