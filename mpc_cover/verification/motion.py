"""Verifies a motion along its continuous path: dynamics, limits, separation and connectivity."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.fleet_constraints import FleetConstraints
from mpc_cover.verification.connectivity import widest_bottleneck
from mpc_cover.verification.ends import check_links
from mpc_cover.verification.limits import (
    check_box,
    check_dynamics,
    check_input,
    check_rest,
    check_speed,
    check_start,
)
from mpc_cover.verification.path import Path
from mpc_cover.verification.report import Check, CheckName, Report
from mpc_cover.verification.separation import smallest_separation
from mpc_cover.verification.tolerance import tolerance_of

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.verification.separation import Distance

_LARGEST = 1e9
"""Numbers beyond this are no motion, and their squares may overflow [s, m, m/s, m/s^2]."""


def verify_motion(
    given: Fleet,
    time: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    force: FloatArray,
    *,
    tolerance: float | None = None,
    at_rest: bool = False,
    start: tuple[FloatArray, FloatArray] | None = None,
) -> Report:
    """Verify a motion along its continuous path under a zero-order hold.

    It never raises on account of the motion: wrong shapes and numbers that are not finite fail the first
    check, and with it all others.

    Parameters
    ----------
    given : limits, box, rho_B (0: not asked for) and rho_C (inf: not asked for). Lost agents are obstacles, whose
        own limits, box and rest are not checked; at least one agent must not be lost.
    time : (T,) [s], strictly increasing, not necessarily even, T >= 2.
    position, velocity : (T, m, d) [m], [m/s].
    force : (T-1, m, d) inputs [m/s^2], held over each interval.
    tolerance : of limits and of residuals [m, m/s, m/s^2]; left out, `tolerance.tolerance_of` the fleet.
    at_rest : whether the fleet must stand still at the end.
    start : (m, d) position [m] and velocity [m/s] that the motion must start in.
    """
    arrays = [time, position, velocity, force, *(start or ())]
    fleet = FleetConstraints.of(given)
    if (wrong := _malformed(fleet, arrays)) is not None:
        return _all_failed(fleet, wrong, at_rest=at_rest, start=start is not None)
    tolerance = tolerance_of(fleet) if tolerance is None else tolerance
    path = Path(*(np.asarray(array, dtype=float) for array in arrays[:4]))
    own, part = taking_part(path, fleet)
    checks = [
        Check(CheckName.NUMBERS, holds=True, margin=0.0, unit="", where="all finite"),
        *check_dynamics(path, fleet.ids, tolerance),
        check_speed(own, part, tolerance),
        check_input(own, part, tolerance),
        check_box(own, part, tolerance),
    ]
    if fleet.size > 1 and fleet.separation_min > 0.0:
        checks.append(_check_separation(path, fleet, tolerance))
    if len(fleet.active) > 1 and np.isfinite(fleet.communication_range):
        checks.append(check_connectivity(path, fleet, tolerance))
    if fleet.links:
        checks.append(check_links(path, fleet, tolerance))
    if at_rest:
        checks.append(check_rest(own, part.ids, tolerance))
    if start is not None:
        checks.extend(check_start(path, start, fleet.ids, tolerance))
    return Report(tuple(checks))


def _check_separation(path: Path, fleet: FleetConstraints, tolerance: float) -> Check:
    """Check ||q_i - q_j|| >= rho_B at every instant (4.18), except for pairs of lost agents."""
    groups = [fleet.active, *((*fleet.active, lost) for lost in fleet.lost)] if fleet.lost else [fleet.active]
    worst, where = np.inf, "nobody is near"
    for group in groups:
        some, part = _part_of(path, fleet, group)
        closest = smallest_separation(some)
        if closest is not None and closest.value < worst:
            worst, where = closest.value, describe(closest, part.ids)
    margin = worst - fleet.separation_min
    return Check(CheckName.SEPARATION, margin >= -tolerance, margin, "m", where)


def taking_part(path: Path, fleet: FleetConstraints) -> tuple[Path, FleetConstraints]:
    """Return the path of the agents that are not lost, and their limits."""
    return _part_of(path, fleet, fleet.active)


def _part_of(path: Path, fleet: FleetConstraints, group: tuple[int, ...]) -> tuple[Path, FleetConstraints]:
    """Return the path of some agents, and their limits."""
    if len(group) == fleet.size:
        return path, fleet
    part = list(group)
    some = Path(path.time, path.position[:, part], path.velocity[:, part], path.force[:, part])
    ids = tuple(fleet.ids[i] for i in part)
    return some, replace(fleet, ids=ids, input_max=fleet.input_max[part], speed_max=fleet.speed_max[part])


def check_connectivity(path: Path, fleet: FleetConstraints, tolerance: float) -> Check:
    """Check that edges of at most rho_C connect the agents that are not lost at every instant (4.20)."""
    path, part = taking_part(path, fleet)
    if len(fleet.active) < 2:  # noqa: PLR2004 - a pair
        return Check(CheckName.CONNECTIVITY, holds=True, margin=np.inf, unit="m", where="nobody to lose touch with")
    widest = widest_bottleneck(path, limit=fleet.communication_range, resolution=0.5 * tolerance)
    assert widest is not None, "asked for with two agents at least"
    margin = fleet.communication_range - widest.value
    return Check(CheckName.CONNECTIVITY, margin >= -tolerance, margin, "m", describe(widest, part.ids))


def describe(distance: Distance, ids: tuple[str, ...]) -> str:
    """Return which pair, and when."""
    return f"{ids[distance.pair[0]]} - {ids[distance.pair[1]]}, t = {distance.time:.3f} s"


def _malformed(fleet: FleetConstraints, arrays: list[FloatArray]) -> str | None:
    """Return why the (time, position, velocity, force, start ...) are not a motion of this fleet, or None."""
    time = arrays[0]
    if np.ndim(time) != 1 or np.size(time) < 2:  # noqa: PLR2004 - one interval
        return f"time has shape {np.shape(time)}, must hold two samples at least"
    state = (fleet.size, fleet.dimension)
    samples = np.size(time)
    shapes = [(samples,), (samples, *state), (samples, *state), (samples - 1, *state), state, state]
    names = ["time", "position", "velocity", "input", "start position", "start velocity"]
    for name, array, shape in zip(names, arrays, shapes, strict=False):
        if np.shape(array) != shape:
            return f"{name} has shape {np.shape(array)}, must be {shape}"
        # written so that NaN fails, too
        if not (good := np.abs(array) <= _LARGEST).all():
            index = [int(i) for i in np.argwhere(~good)[0]]
            return f"{name}{index} is {np.asarray(array)[tuple(index)]}, must be finite and below {_LARGEST:g}"
    if not (forward := np.diff(time) > 0.0).all():
        return f"time[{int(np.argmin(forward)) + 1}] is not after the one before"
    return None


def _all_failed(fleet: FleetConstraints, wrong: str, *, at_rest: bool, start: bool) -> Report:
    """Return a report in which every check has failed, because the arrays are not a motion."""
    connected = len(fleet.active) > 1 and np.isfinite(fleet.communication_range)
    asked = {
        CheckName.DYNAMICS_POSITION: "m",
        CheckName.DYNAMICS_VELOCITY: "m/s",
        CheckName.SPEED: "m/s",
        CheckName.INPUT: "m/s^2",
        CheckName.BOX: "m",
        **({CheckName.SEPARATION: "m"} if fleet.size > 1 and fleet.separation_min > 0.0 else {}),
        **({CheckName.CONNECTIVITY: "m"} if connected else {}),
        **({CheckName.LINKS: "m"} if fleet.links else {}),
        **({CheckName.REST: "m/s"} if at_rest else {}),
        **({CheckName.START_POSITION: "m", CheckName.START_VELOCITY: "m/s"} if start else {}),
    }
    skipped = (Check(name, False, -np.inf, unit, "not looked at") for name, unit in asked.items())
    return Report((Check(CheckName.NUMBERS, holds=False, margin=-np.inf, unit="", where=wrong), *skipped))
