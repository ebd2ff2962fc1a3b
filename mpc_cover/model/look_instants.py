"""When sensors look along a motion: at its samples, several times a step, or without a break.

Between samples a motion is a parabola (4.23), whose points are linear in the state at the sample before and the
velocity at the sample after: q(n + s) = q_n + T (s - s^2/2) v_n + T s^2/2 v_(n+1), s in [0, 1]. The distance
to a cell's nearest point of an interval, held at its s, is therefore as convex as that to a sample.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.mission.config import Sensing
from mpc_cover.mission.information import InformationKind

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.trajectory import Trajectory

_OVERLAP, _DENSE_LOOKS = 0.9, 0.5
"""Distances of samples at full speed, in sensing radii, up to which looks at samples alone are counted on, and of looks
where those are not enough; plain choices. At the first, the swath is a tenth narrower than without a break."""
_ROUNDING = 1e-9
"""Part of a look by which a step may be too short for it: a quotient of periods is rounded."""
_NEWTON = 6
"""Newton steps to the nearest point of a parabola, which reach rounding from near by; a plain choice."""
_PART_REACH, _PARTS_MAX = 0.5, 16
"""Distance of the points, in sensing radii, from which continuous looks are refined, and the most of an interval. Plain
choices: a parabola that bends twice as sharply has no minimum of its own between them."""


@dataclass(frozen=True)
class LookInstants:
    """The instants of looks within each step of a motion.

    Attributes
    ----------
    per_step : looks a step, evenly spaced, the first at its sample; 1 as in the thesis.
    continuous : whether every point of the path counts.
    """

    per_step: int = 1
    continuous: bool = False

    @property
    def only_samples(self) -> bool:
        """Whether nothing counts between samples."""
        return self.per_step == 1 and not self.continuous


AT_SAMPLES = LookInstants()
"""One look a step, at its sample."""


def measures_on_the_way(mission: Mission) -> bool:
    """Return whether what is passed between samples and reports counts: by continuous sensing if one look suffices."""
    return mission.spec.sensing is Sensing.CONTINUOUS and not mission.spec.looks_again


def looks_of_plans(mission: Mission, step_s: float) -> LookInstants:
    """Return the instants that offline plans with samples every `step_s` [s] count on: once a period T_s (4.34)."""
    if measures_on_the_way(mission):
        return LookInstants(continuous=True)
    return LookInstants(per_step=max(1, round(step_s / mission.spec.control.period_s)))


def looks_in_flight(mission: Mission, step_s: float) -> LookInstants:
    """Return the instants that plans in flight with samples every `step_s` [s] count on: some of those of reports.

    Where discs of successive samples overlap well, these suffice, and cost least; else as many reports as it takes.
    """
    if measures_on_the_way(mission):
        return LookInstants(continuous=True)
    if mission.spec.looks_again and mission.spec.information_kind is not InformationKind.AGEING:
        return AT_SAMPLES  # an agent's looks at a cell count a period apart
    fleet = mission.fleet
    radius = np.where(np.isfinite(fleet.radius), fleet.radius, np.inf).min(axis=1)
    apart = float((fleet.speed_max / radius).max()) * step_s
    most = max(1, int(step_s / mission.spec.control.state_period_s + _ROUNDING))
    if apart <= _OVERLAP:
        return LookInstants()
    enough = [count for count in range(1, most + 1) if most % count == 0 and apart / count <= _DENSE_LOOKS]
    return LookInstants(per_step=min(enough, default=most))


@dataclass(frozen=True, eq=False)
class InterSample:
    """A motion between its samples, and the looks that count there.

    Attributes
    ----------
    velocity : (N+1, m, d) [m/s] at the samples.
    period : T [s] from sample to sample.
    instants : of the looks.
    """

    velocity: FloatArray
    period: float
    instants: LookInstants

    def parts(self, radius: float) -> FloatArray:
        """Return the (k,) parts s of an interval, 0 first, that are looked at, or that continuous looks start from.

        `radius` is the smallest sensing radius [m].
        """
        count = self.instants.per_step
        if self.instants.continuous:
            speed = float(np.linalg.norm(self.velocity, axis=-1).max(initial=0.0))
            count = int(np.clip(np.ceil(speed * self.period / (_PART_REACH * radius)), 1, _PARTS_MAX))
        return np.asarray(np.arange(count) / count)

    def blend(self, part: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the factors [s] of the velocities at the sample before and the one after, at parts of intervals."""
        later = 0.5 * self.period * part**2
        return self.period * part - later, later

    def flat(self) -> tuple[FloatArray, FloatArray]:
        """Return velocities ((N+1) m, d) [m/s] at the samples, and at the samples after; the last lasts."""
        following = np.concatenate([self.velocity[1:], self.velocity[-1:]])
        dimension = self.velocity.shape[2]
        return self.velocity.reshape(-1, dimension), following.reshape(-1, dimension)

    def points(self, position: FloatArray, part: float) -> FloatArray:
        """Return the points (N, m, d) [m] of all intervals at a part of each; `position` (N+1, m, d) [m]."""
        before, after = self.blend(np.asarray(part))
        return np.asarray(position[:-1] + before * self.velocity[:-1] + after * self.velocity[1:])


def inter_sample(motion: Trajectory, instants: LookInstants) -> InterSample | None:
    """Return what counts between the samples of an evenly sampled motion of a fleet; None if nothing does."""
    return None if instants.only_samples else InterSample(motion.velocity, motion.period, instants)


def nearest_part(
    offset: FloatArray,
    before: FloatArray,
    after: FloatArray,
    period: float | FloatArray,
    bounds: tuple[FloatArray, FloatArray],
) -> FloatArray:
    """Return the parts s (...,) of intervals at which parabolas come nearest to the origin, within bounds of s.

    `offset` (..., d) [m] is where they are at s = 0, `before` and `after` (..., d) [m/s] the velocities at both ends,
    `period` [s] one for all or (...,). Starts from the middle of the bounds; the better end if that is nearer.
    """
    low, high = bounds
    step = np.asarray(period)[..., None]
    slope, bend = before * step, 0.5 * (after - before) * step
    part = 0.5 * (low + high)
    for _ in range(_NEWTON):
        at = part[..., None]
        here, rate = offset + at * slope + at**2 * bend, slope + 2.0 * at * bend
        first, second = (here * rate).sum(axis=-1), (rate * rate + 2.0 * here * bend).sum(axis=-1)
        gauss = (rate * rate).sum(axis=-1)
        steepness = np.where(second > 0.0, second, gauss)
        part = np.clip(part - np.divide(first, steepness, out=np.zeros_like(first), where=steepness > 0.0), low, high)
    tried = np.stack([part, low, high])
    at = tried[..., None]
    square = ((offset + at * slope + at**2 * bend) ** 2).sum(axis=-1)
    return np.asarray(np.take_along_axis(tried, square.argmin(axis=0)[None], axis=0)[0])
