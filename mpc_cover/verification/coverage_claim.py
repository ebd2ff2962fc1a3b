"""Checks that the coverage a trajectory claims is what its positions measured: no earlier, and no later."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.mission.config import Sensing
from mpc_cover.verification.left_out import with_claimed_looks, with_left_out_looks
from mpc_cover.verification.looks import rule_of, settled_at
from mpc_cover.verification.loss_evidence import SAME_TIME, of_the_living
from mpc_cover.verification.losses import losses_of
from mpc_cover.verification.path import Path
from mpc_cover.verification.report import Check, CheckName
from mpc_cover.verification.resolution import Resolution

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.trajectory_file import Recording

_TIE = 1e-9
"""A cell at distance exactly rho counts as measured, in spite of rounding [m]."""
_DOUBT = 1e-10
"""Within this of the tie [m], rounding decides, and either answer is honest."""
_SUM = 1e-9
"""Within this part of what is asked for, the rounding of sums decides, and either answer is honest."""
_NO_BEND = 1e-9
"""Ratio of coefficients below which a parabola is a line, whose other roots are far outside the interval."""
_PER_RADIUS = 16.0
"""By how much what a look adds, in parts of what is asked for, may change with its distance in sensing radii; a bump's
slope is at most 1.6 of its peak, and some ten looks add up. A plain choice."""
_STRIP = 1.01
"""Half the width, in units of the reach, of the strip of cells that are looked at; 1 but for rounding."""
_SAME_TIME = 1e-9
_SAME_CELL = 1e-9
_DIGITS = 4.0
"""Rounding of a cell's coordinates, in last digits of the largest; a plain choice."""
_EXACT = Resolution()


def check_coverage(trajectory: Recording, resolution: Resolution = _EXACT) -> list[Check]:
    """Check the cells against the mission's, and `covered_at` against the discs flown (3.23, 4.29).

    The lost measure nothing. Looks that a thinned record left out may have been what a cell is covered by.
    """
    cells = _check_cells(trajectory, resolution)
    if not cells.holds:
        names = (CheckName.COVERAGE_CLAIMED, CheckName.COVERAGE_KEPT)
        return [cells, *(Check(name, False, -np.inf, "s", "not looked at") for name in names)]
    mission = trajectory.mission
    seen, losses, radius = replace(trajectory, cell=mission.field.cell), losses_of(trajectory), mission.fleet.radius
    # a look more or less may move the later ones of an agent: both readings of a thinned record are honest
    put_in = with_left_out_looks if rule_of(mission) is not None else with_claimed_looks
    whole, doubt, early_s = put_in(seen, resolution.time_s), resolution.length, 2.0 * resolution.time_s
    part, rim = _SUM + _PER_RADIUS * doubt / mission.fleet.sensing_radius_min, _DOUBT + doubt
    earliest, latest = np.full(mission.field.size, np.inf), np.full(mission.field.size, -np.inf)
    for read in (seen,) if whole is seen else (seen, whole):
        alive, rest = of_the_living(read, losses), of_the_living(read, losses, -SAME_TIME)
        earliest = np.minimum(earliest, first_measured(alive, radius + _TIE + rim, 1.0 - part, early_s))
        latest = np.maximum(latest, first_measured(rest, radius + _TIE - rim, 1.0 + part, early_s))
    claimed, same_s = trajectory.covered_at, _SAME_TIME + early_s
    return [
        cells,
        _check_claim(CheckName.COVERAGE_CLAIMED, _difference(claimed, earliest), trajectory, earliest, same_s),
        _check_claim(CheckName.COVERAGE_KEPT, _difference(latest, claimed), trajectory, latest, same_s),
    ]


def first_measured(trajectory: Recording, radius: FloatArray, part: float = 1.0, early_s: float = 0.0) -> FloatArray:
    """Return (K,) [s]: the first sample by which every magnitude was measured on each cell; inf where never.

    `radius` is (m, J) [m], -inf where an agent cannot measure a magnitude. Where the mission asks for more than one
    look, `part` of what it asks for suffices, and looks may come `early_s` [s] too soon. A patrol's cells count from
    their first look.
    """
    if (rule := rule_of(trajectory.mission)) is not None:
        return settled_at(trajectory, radius, rule, part * rule.level, early_s)
    if trajectory.mission.spec.sensing is Sensing.CONTINUOUS:
        return first_passed(trajectory, radius)
    order = np.argsort(trajectory.cell[:, 0], kind="stable")
    cell = trajectory.cell[order]
    done = np.zeros(order.size)
    for reach in radius.T:
        done[order] = np.maximum(done[order], _first_within(trajectory, cell, reach))
    return done


def _first_within(trajectory: Recording, cell: FloatArray, reach: FloatArray) -> FloatArray:
    """Return (K,) [s]: the first sample within `reach` (m,) [m] of each of the cells (K, d), sorted by coordinate 0."""
    first = np.full(cell.shape[0], np.inf)
    for agent in np.flatnonzero(reach > 0.0):
        path, far = trajectory.position[:, agent], _STRIP * reach[agent]
        begin, end = (np.searchsorted(cell[:, 0], path[:, 0] + side) for side in (-far, far))
        for n, here in enumerate(path):
            owed = begin[n] + np.flatnonzero(first[begin[n] : end[n]] > trajectory.time[n])
            offset = cell[owed] - here
            first[owed[np.einsum("kd,kd->k", offset, offset) <= reach[agent] ** 2]] = trajectory.time[n]
    return first


def first_passed(trajectory: Recording, radius: FloatArray) -> FloatArray:
    """Return (K,) [s]: the first sample by which the path had passed each cell in range, of every magnitude."""
    path, cells = Path(trajectory.time, trajectory.position, trajectory.velocity, trajectory.input), trajectory.cell
    first = np.full((radius.shape[1], cells.shape[0]), np.inf)
    for agent, reach in enumerate(radius):
        able = np.flatnonzero(reach > 0.0)
        for n in range(trajectory.input.shape[0] if able.size else 0):
            step, least = path.time[n + 1] - path.time[n], np.full(cells.shape[0], np.inf)
            begin, rate = path.position[n, agent], path.velocity[n, agent] * step
            bend = 0.5 * path.force[n, agent] * step**2
            # the path is within its first point's ball of |rate| + |bend|
            away = np.linalg.norm(cells - begin, axis=1)
            some = np.flatnonzero(away <= np.linalg.norm(rate) + np.linalg.norm(bend) + reach[able].max())
            least[some] = parabola_distance(begin - cells[some], rate, bend)
            for j in able:
                first[j, least <= reach[j]] = np.minimum(first[j, least <= reach[j]], path.time[n + 1])
                if n == 0:
                    first[j, away <= reach[j]] = path.time[0]
    return np.asarray(first.max(axis=0))


def parabola_distance(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return (K,) [m]: the least |a + b s + c s^2| over s in [0, 1], of offsets `a` (K, d) and one (d,) motion [m].

    It is at an end or at a root of the cubic derivative of its square, found in closed form.
    """
    constant, linear = a @ b, 2.0 * (a @ c) + float(b @ b)
    square, cubic = 3.0 * float(b @ c), 2.0 * float(c @ c)
    roots = _roots(cubic, square, linear, constant)
    inside = [np.clip(np.where(np.isfinite(root), root, 0.0), 0.0, 1.0) for root in roots]
    tried = [np.zeros_like(constant), np.ones_like(constant), *inside]
    parts = np.stack(tried)[..., None]
    return np.asarray(np.linalg.norm(a + parts * b + parts**2 * c, axis=2).min(axis=0))


def _roots(cubic: float, square: float, linear: FloatArray, constant: FloatArray) -> list[FloatArray]:
    """Return the real parts of the roots of polynomials in s, as eigenvalues of their companion matrices."""
    largest = np.maximum(np.abs(linear), max(abs(cubic), abs(square)))
    if cubic > _NO_BEND * float(largest.max(initial=0.0)):
        matrix = np.zeros((constant.size, 3, 3))
        matrix[:, 1, 0] = matrix[:, 2, 1] = 1.0
        matrix[:, 0, 2], matrix[:, 1, 2], matrix[:, 2, 2] = -constant / cubic, -linear / cubic, -square / cubic
        return list(np.linalg.eigvals(matrix).real.T)
    return [-np.divide(constant, linear, out=np.zeros_like(constant), where=linear != 0.0)]


def _check_cells(trajectory: Recording, resolution: Resolution) -> Check:
    """Check that the file's cells are those that its mission is cut into."""
    expected = trajectory.mission.field.cell
    if trajectory.cell.shape != expected.shape or trajectory.covered_at.shape != expected.shape[:1]:
        where = f"cell {trajectory.cell.shape}, covered_at {trajectory.covered_at.shape}, must be {expected.shape}"
        return Check(CheckName.CELLS, False, -np.inf, "m", where)
    away = np.linalg.norm(trajectory.cell - expected, axis=1)
    k = int(np.argmax(away))
    margin = float(_SAME_CELL + _DIGITS * np.spacing(np.abs(expected).max()) + resolution.cell_m - away[k])
    return Check(CheckName.CELLS, margin >= 0.0, margin, "m", f"cell {k}")


def _difference(later: FloatArray, sooner: FloatArray) -> FloatArray:
    """Return later - sooner [s], where never equals never."""
    both_never = np.isinf(later) & np.isinf(sooner)
    return np.subtract(later, sooner, out=np.zeros_like(later), where=~both_never)


def _check_claim(name: CheckName, slack: FloatArray, trajectory: Recording, truth: FloatArray, same_s: float) -> Check:
    """Return the check whose margin is the smallest of the (K,) slacks [s]."""
    bad = ~(slack >= -same_s)
    if not bad.any():
        return Check(name, holds=True, margin=float(max(0.0, slack.min())), unit="s", where=f"{slack.size} cells")
    k = int(np.argmin(slack))
    cell = ", ".join(f"{x:.3g}" for x in trajectory.cell[k])
    more = f" and {int(bad.sum()) - 1} more" if bad.sum() > 1 else ""
    claim, fact = _describe(trajectory.covered_at[k], "covered"), _describe(truth[k], "measured")
    return Check(name, False, float(slack[k]), "s", f"cell {k} at ({cell}){more}: claimed {claim}, was {fact}")


def _describe(time: float, done: str) -> str:
    return f"{done} at t = {time:.3f} s" if np.isfinite(time) else f"never {done}"
