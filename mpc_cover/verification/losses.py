"""Verifies a motion during which agents are lost: from then on the others must stay connected without them.

The loss of a relay may leave the others out of range of each other. No plan can prevent that, but the fleet must
notice, come no farther apart, and reconnect: how long it was apart is reported, whether it did so is checked.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.model.fleet_constraints import FleetConstraints
from mpc_cover.trajectory_file import RecordingKind
from mpc_cover.verification.connectivity import bottlenecks
from mpc_cover.verification.ends import check_links
from mpc_cover.verification.motion import check_connectivity, taking_part, verify_motion
from mpc_cover.verification.path import Path
from mpc_cover.verification.report import Check, CheckName, Report

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray
    from mpc_cover.trajectory_file import Recording

REACTION_PERIODS = 2.0
"""Within so many control periods a loss is detected and the others fly a plan without the lost agent."""
_SAME_TIME = 1e-6
_LARGEST = 1e9
"""Beyond it nothing is a time of a flight [s]."""


@dataclass(frozen=True)
class Separation:
    """A time during which the remaining agents were out of range of each other.

    Attributes
    ----------
    begin, end : [s]; `end` is inf when they never reconnected.
    largest : the longest edge of their tree [m].
    loss : time of the loss that caused it [s]; None when there was no loss just before.
    allowed : the longest edge by the time at which the others could have noticed and stopped [m].
    later : the longest edge after that [m].
    unnoticed : whether the record ends before they could have noticed and stopped: there was no time to reconnect.
    """

    begin: float
    end: float
    largest: float
    loss: float | None = None
    allowed: float = 0.0
    later: float = 0.0
    unnoticed: bool = False

    @property
    def excused(self) -> bool:
        """Whether a loss was the cause, they came no farther apart than they had to, and reconnected."""
        reconnected = bool(np.isfinite(self.end)) or self.unnoticed
        return self.loss is not None and self.later <= self.allowed + _SAME_TIME and reconnected


def losses_of(trajectory: Recording) -> dict[int, float]:
    """Return {agent index: time of its loss [s]} from the file's meta; unreadable entries are ignored.

    Nobody is lost in a plan.
    """
    if trajectory.meta.get("kind") == RecordingKind.PLAN:
        return {}
    lost: Any = trajectory.meta.get("lost")
    if not isinstance(lost, dict):
        return {}
    ids = trajectory.mission.fleet.ids
    times = {ids.index(name): time for name, time in lost.items() if name in ids and type(time) in {int, float}}
    return {index: float(time) for index, time in times.items() if -_LARGEST <= time <= _LARGEST}  # neither is NaN


def verify_with_losses(
    trajectory: Recording, losses: dict[int, float], *, tolerance: float, start: tuple[FloatArray, FloatArray]
) -> Report:
    """Verify a flight; connectivity segment by segment between losses, each with the remaining agents.

    A lost agent remains an obstacle, and its own motion must still obey dynamics and limits.
    """
    fleet = trajectory.mission.fleet
    alone = replace(fleet, communication_range=np.inf, links=())
    arrays = (trajectory.time, trajectory.position, trajectory.velocity, trajectory.input)
    report = verify_motion(alone, *arrays, tolerance=tolerance, start=start)
    if not report.checks[0].holds:
        return report
    checks = list(report.checks)
    if np.isfinite(fleet.communication_range):
        checks += _check_connectivity(trajectory, losses, tolerance)
    linked = [check_links(path, part, tolerance) for path, part in segments(trajectory, losses) if part.links]
    if linked:
        checks.append(min(linked, key=lambda check: check.margin))
    return Report(tuple(checks))


def segments(trajectory: Recording, losses: dict[int, float]) -> Iterator[tuple[Path, FleetConstraints]]:
    """Yield the path between losses with the fleet then; an agent lost during an interval is lost from its start."""
    fleet, end = trajectory.mission.fleet, len(trajectory.time) - 1
    begins = {i: _sample_of(trajectory, loss) for i, loss in losses.items()}
    cuts = {0, end} | {min(begin, end) for begin in begins.values()}
    for first, last in pairwise(sorted(cuts)):
        lost = tuple(sorted(i for i, begin in begins.items() if begin <= first))
        links = tuple(link for link in fleet.links if not set(link) & set(lost))
        part = slice(first, last + 1)
        path = Path(
            trajectory.time[part], trajectory.position[part], trajectory.velocity[part], trajectory.input[first:last]
        )
        yield path, FleetConstraints.of(fleet, lost=lost, links=links)


def _sample_of(trajectory: Recording, loss: float) -> int:
    """Return the sample at which the interval of a loss begins."""
    return max(0, int(np.searchsorted(trajectory.time, loss, side="right")) - 1)


def separations(trajectory: Recording, losses: dict[int, float], tolerance: float) -> list[Separation]:
    """Return when the remaining agents were out of range of each other, in the order of time."""
    time, longest = _longest_edges(trajectory, losses)
    apart = longest > trajectory.mission.fleet.communication_range + tolerance
    edges = np.flatnonzero(np.diff(np.concatenate([[False], apart, [False]]).astype(int)))
    found = []
    for first, after in zip(edges[::2], edges[1::2], strict=True):
        end = float(time[after]) if after < apart.size else np.inf
        found.append(_attributed(trajectory, losses, time[first:after], longest[first:after], end))
    return found


def _attributed(
    trajectory: Recording, losses: dict[int, float], time: FloatArray, longest: FloatArray, end: float
) -> Separation:
    """Attribute a separation to the last loss before it, if that may be its cause."""
    fleet, begin, largest = trajectory.mission.fleet, float(time[0]), float(longest.max())
    reaction = REACTION_PERIODS * trajectory.mission.spec.control.period_s + float(
        (fleet.speed_max / fleet.input_max).max()
    )
    # a second loss may come while they are still apart: what it adds is its own
    causes = [loss for loss in losses.values() if begin - reaction <= loss + _SAME_TIME and loss < end]
    if not any(trajectory.time[_sample_of(trajectory, loss)] <= begin + _SAME_TIME for loss in causes):
        return Separation(begin, end, largest)
    loss = max(causes)
    early = time <= loss + reaction + _SAME_TIME
    allowed = float(longest[early].max()) if early.any() else 0.0
    unnoticed = float(trajectory.time[-1]) <= loss + reaction + _SAME_TIME
    return Separation(begin, end, largest, loss, allowed, float(longest[~early].max(initial=0.0)), unnoticed)


def _longest_edges(trajectory: Recording, losses: dict[int, float]) -> tuple[FloatArray, FloatArray]:
    """Return when pieces of the path begin (n,) [s], and the longest edge of the tree within each (n,) [m]."""
    times, edges = [], []
    for path, fleet in segments(trajectory, losses):
        if len(fleet.active) > 1:
            time, longest = bottlenecks(taking_part(path, fleet)[0])
        else:
            time, longest = path.time[:-1], np.zeros(path.time.size - 1)
        times.append(time)
        edges.append(longest)
    return np.concatenate(times), np.concatenate(edges)


def _check_connectivity(trajectory: Recording, losses: dict[int, float], tolerance: float) -> list[Check]:
    """Check that the longest edge is at most rho_C (4.20) but for separations that losses excuse, and report those."""
    exact = [check_connectivity(path, fleet, tolerance) for path, fleet in segments(trajectory, losses)]
    if all(check.holds for check in exact):
        return [min(exact, key=lambda check: check.margin)]
    time, longest = _longest_edges(trajectory, losses)
    reach = trajectory.mission.fleet.communication_range
    excused = [one for one in separations(trajectory, losses, tolerance) if one.excused]
    counts = np.ones(time.size, dtype=bool)
    for one in excused:
        counts &= (time < one.begin) | (time >= one.end)
    worst = int(np.argmax(np.where(counts, longest, -np.inf)))
    margin = reach - float(longest[worst])
    where = f"those left, t = {time[worst]:.3f} s"
    checks = [Check(CheckName.CONNECTIVITY, margin >= -tolerance, margin, "m", where)]
    for one in excused:
        end = min(one.end, float(trajectory.time[-1]))
        where = (
            f"after the loss at t = {one.loss:.2f} s the others were apart for {end - one.begin:.2f} s, "
            f"by {one.largest:.3f} m, from t = {one.begin:.2f} s to t = {end:.2f} s"
        ) + ", the end of the record: too soon to meet" * (one.end > end)
        slack = one.allowed - max(one.later, reach)
        checks.append(Check(CheckName.RECONNECTION, holds=True, margin=slack, unit="m", where=where))
    return checks
