"""When a cell is settled, as the verifier derives it from the mission: after enough looks, each adding an amount."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.mission.information import EffectiveInformation, KalmanInformation

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.trajectory_file import Recording

_NEARLY = 1.0 - 1e-12
"""What a level may be missed by in rounding, as ten times 0.1 does."""
_SOON = 1e-6
"""Part of a period that an agent's next look at a cell may come too soon."""


@dataclass(frozen=True)
class Rule:
    """A cell is settled when its looks sum to `level`; one adds `rim` at the radius, and `peak` at the agent.

    An agent's looks at a cell are a period [s] apart at least.
    """

    level: float
    peak: float
    rim: float
    period_s: float

    def amount(self, part: FloatArray) -> FloatArray:
        """Return what looks add that are taken from a part of the radius, 0 to 1, away."""
        fall = np.clip(1.0 - part * part, 0.0, 1.0)
        return np.asarray(self.rim + (self.peak - self.rim) * fall * fall)


def rule_of(mission: Mission) -> Rule | None:
    """Return the mission's rule, or None where the first look settles a cell."""
    given, period = mission.spec.information, mission.spec.control.period_s
    if isinstance(given, EffectiveInformation):
        if given.least < given.peak:
            return Rule(given.level, given.peak, given.least, period)
        return _counting(given.level * _NEARLY / given.peak, period)
    if isinstance(given, KalmanInformation):
        # each reading adds 1/R to 1/P, which must grow from 1/P(0) to 1/P_max
        missing = _NEARLY / given.target_variance - 1.0 / given.prior_variance
        return _counting(missing * given.noise_variance, period)
    return _counting(mission.spec.looks, period) if mission.spec.looks > 1 else None


def _counting(looks: float, period: float) -> Rule:
    """Return the rule that asks for so many looks, rounded up, less half a look, so that no rounding matters."""
    return Rule(math.ceil(looks) - 0.5, 1.0, 1.0, period)


def settled_at(trajectory: Recording, radius: FloatArray, rule: Rule, level: float, early_s: float = 0.0) -> FloatArray:
    """Return (K,) [s]: the first sample by which the looks at each cell summed to `level`, for every magnitude.

    `radius` is (m, J) [m], -inf where an agent cannot measure a magnitude. Every agent looks at what is in range as
    soon as a look counts, or `early_s` [s] before that.
    """
    times = [_of_magnitude(trajectory, reach, rule, level, early_s) for reach in radius.T]
    return np.asarray(np.max(times, axis=0))


def _of_magnitude(trajectory: Recording, reach: FloatArray, rule: Rule, level: float, early_s: float) -> FloatArray:
    soon = rule.period_s * (1.0 - _SOON) - early_s
    cells = trajectory.cell.shape[0]
    able = np.flatnonzero(reach > 0.0)
    last = np.full((able.size, cells), -np.inf)
    total, when = np.zeros(cells), np.full(cells, np.inf)
    for time, position in zip(trajectory.time, trajectory.position, strict=True):
        for row, agent in enumerate(able):
            square = np.sum((trajectory.cell - position[agent]) ** 2, axis=1)
            seen = (square <= reach[agent] ** 2) & (time - last[row] >= soon)
            total[seen] += rule.amount(np.sqrt(square[seen]) / reach[agent])
            last[row, seen] = time
        when[(total >= level) & np.isinf(when)] = time
        if np.isfinite(when).all():
            break
    return when
