"""How exactly a file holds its numbers: copies in single precision are judged by what rounding did to them, no more.

A recording whose positions, velocities and inputs all are single-precision numbers counts as rounded to them; in double
precision nothing is lost that `tolerance_of` does not cover.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.trajectory_file import Recording

_COARSEST, _COARSEST_SUM = 2e-4, 2e-3
"""Rounding of more than these parts of the smallest sensing radius, of an interval and in sum, is no copy of a motion
any more. Plain choices: single precision holds a quarter of an hour within 100 m that well."""
_CHANCE = 8.0
"""Sums of independent rounding errors stay below so many times the root of the sum of their squares: Hoeffding's
inequality gives exceptions a chance of exp(-32)."""


@dataclass(frozen=True)
class Resolution:
    """What rounding may have done to a recording; all zero in double precision.

    Attributes
    ----------
    length : to distances, speeds, and to the residual of an interval [m, m/s].
    time_s : to times [s].
    cell_m : to the coordinates of cells [m].
    position_sum, velocity_sum : to the sum of any number of residuals [m], [m/s].
    """

    length: float = 0.0
    time_s: float = 0.0
    cell_m: float = 0.0
    position_sum: float = 0.0
    velocity_sum: float = 0.0


def resolution_of(trajectory: Recording) -> Resolution:
    """Return what rounding may have done to the numbers of a recording; nothing where its arrays are no motion."""
    samples, shape = trajectory.time.size, trajectory.position.shape
    if samples < 2 or len(shape) != 3 or trajectory.input.shape != (samples - 1, *shape[1:]):  # noqa: PLR2004
        return Resolution()
    time, position, velocity, force = (
        _half_digit(array) for array in (trajectory.time, trajectory.position, trajectory.velocity, trajectory.input)
    )
    if not (position and velocity and force):
        return Resolution()
    cell = _half_digit(trajectory.cell)
    axes = float(np.sqrt(trajectory.position.shape[2]))
    step = np.diff(trajectory.time)
    longest, whole = float(step.max()), float(trajectory.time[-1] - trajectory.time[0])
    speed, push = (float(np.linalg.norm(a, axis=2).max()) for a in (trajectory.velocity, trajectory.input))
    # each term of q+ = q + h v + h^2/2 u and v+ = v + h u (4.23), by how far rounding moves it
    moved = axes * (2.0 * position + 2.0 * longest * velocity + longest**2 * force)
    moved += 2.0 * time * (speed + longest * push)
    turned = axes * (2.0 * velocity + 2.0 * longest * force) + 2.0 * time * push
    fleet = trajectory.mission.fleet
    coarsest, coarsest_sum = _COARSEST * fleet.sensing_radius_min, _COARSEST_SUM * fleet.sensing_radius_min
    # in sums, the errors of positions and times cancel from interval to interval; those of held values add up
    turns = step[:, None, None] * trajectory.input
    jumps = np.diff(trajectory.input, axis=0)
    position_sum = axes * (2.0 * position + whole * (velocity + longest * force))
    position_sum += 2.0 * time * (speed + _CHANCE * _root_sum(turns))
    velocity_sum = axes * (2.0 * velocity + whole * force) + 2.0 * time * (push + _CHANCE * _root_sum(jumps))
    sums = min(position_sum, coarsest_sum), min(velocity_sum, coarsest_sum)
    return Resolution(min(max(moved, turned), coarsest), time, cell * axes, *sums)


def _root_sum(changes: FloatArray) -> float:
    """Return the largest root of an agent's sum of squares of changes (n, m, d)."""
    return float(np.sqrt((changes**2).sum(axis=(0, 2))).max(initial=0.0))


def _half_digit(values: FloatArray) -> float:
    """Return half the last digit of an array's largest number where all are of single precision, else 0."""
    with np.errstate(over="ignore", invalid="ignore"):
        single = values.astype(np.float32)
    if not (single == values).all() or not values.size:
        return 0.0
    return 0.5 * float(np.spacing(np.abs(single).max(initial=np.float32(0.0))))
