"""Makes the information map, sensing and true field of a mission."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.information.coverage_map import CoverageMap
from mpc_cover.information.effective import Bump, EffectiveCoverage, k_coverage
from mpc_cover.information.flight_map import FlightMap
from mpc_cover.information.kalman import KalmanMap
from mpc_cover.information.paced import PacedSensing
from mpc_cover.information.patrol import PatrolMap
from mpc_cover.information.scalar_field import TimedReadings, bumpy_field
from mpc_cover.information.visibility import Visibility
from mpc_cover.mission.information import AgeingInformation, EffectiveInformation, KalmanInformation

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.information.demand import FlownMap
    from mpc_cover.information.looks import Looks, Sensing
    from mpc_cover.information.residual_map import ResidualMap
    from mpc_cover.mission.load import Mission


def make_map(mission: Mission, margin_m: float | None = None) -> FlownMap:
    """Return an empty map of the kind that the mission asks for.

    Sensing radii are shortened by `margin_m` [m], by default the noise of the mission's positions.
    """
    given = mission.spec.information
    if not mission.spec.looks_again:
        return CoverageMap(mission, margin_m)
    noise_m = mission.spec.disturbance.position_noise_m if margin_m is None else margin_m
    visibility = _Conservative(mission, noise_m) if noise_m else Visibility(mission.field, mission.fleet.radius)
    if isinstance(given, AgeingInformation):
        return PatrolMap(visibility, given.age_limit_s, given.growth_per_s)
    pace = PacedSensing(visibility, mission.fleet.size, mission.spec.control.period_s)
    sensor, graded = sensor_of(mission, pace), isinstance(given, EffectiveInformation | KalmanInformation)
    return FlightMap(settling_map(mission, sensor), pace, sensor, graded=graded)


def settling_map(mission: Mission, sensing: Sensing) -> ResidualMap:
    """Return an empty map that looks settle for good: for all missions but patrols."""
    given = mission.spec.information
    if isinstance(given, EffectiveInformation):
        return EffectiveCoverage(sensing, given.level, Bump(given.peak, given.least))
    if isinstance(given, KalmanInformation):
        variances = {"variance": given.prior_variance, "noise": given.noise_variance}
        return KalmanMap(sensing, **variances, enough=given.target_variance, mean=given.prior_mean)
    return k_coverage(sensing, mission.spec.looks)


def sensor_of(mission: Mission, sensing: Sensing) -> Sensing:
    """Return the sensing with the readings that the mission's simulated sensors take, if its maps ask for them."""
    given = mission.spec.information
    if not isinstance(given, KalmanInformation):
        return sensing
    return TimedReadings(sensing, true_field(mission), given.noise_variance, given.field.seed)


def true_field(mission: Mission) -> FloatArray:
    """Return (J, K): what simulated sensors read without their noise, one field for each magnitude.

    Columns for the survivors of different faults (4.1) are of the same magnitude.
    """
    given = mission.spec.information
    assert isinstance(given, KalmanInformation)
    names = len(mission.spec.magnitudes)
    rng = np.random.default_rng(given.field.seed)
    fields = [bumpy_field(mission.field.cell, rng, given.field.bumps, given.field.amplitude) for _ in range(names)]
    return np.repeat(np.array(fields), len(mission.fleet.magnitudes) // names, axis=0)


def estimate_error(mission: Mission, known: ResidualMap) -> float | None:
    """Return the root mean square error of a map's estimate of the true field; None for maps that estimate nothing."""
    if not isinstance(known, KalmanMap):
        return None
    return float(np.sqrt(np.mean((known.estimate - true_field(mission)) ** 2)))


class _Conservative:
    """Visibility from positions with a bounded error: counted looks are truly in range, distances upper bounds."""

    def __init__(self, mission: Mission, noise_m: float) -> None:
        self._visibility = Visibility(mission.field, mission.fleet.radius - noise_m)
        self._noise = noise_m

    @property
    def shape(self) -> tuple[int, int]:
        return self._visibility.shape

    def looks(self, time_s: float | FloatArray, position: FloatArray, agent: IntArray | None = None) -> Looks:
        seen = self._visibility.looks(time_s, position, agent)
        return replace(seen, distance=seen.distance + self._noise, radius=seen.radius + self._noise)
