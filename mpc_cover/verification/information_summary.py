"""Summary of the information that a mission asks for, at the end of a run: looks, variances, ages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.information.build import make_map, true_field
from mpc_cover.information.flight_map import FlightMap
from mpc_cover.information.kalman import KalmanMap
from mpc_cover.information.patrol import PatrolMap
from mpc_cover.mission.information import EffectiveInformation, InformationKind, KalmanInformation
from mpc_cover.verification.loss_evidence import of_the_living
from mpc_cover.verification.losses import losses_of

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.trajectory_file import Recording


def summarise_information(trajectory: Recording) -> dict[str, Any] | None:
    """Return the figures of the mission's kind of information; None where a cell's first look is all.

    The lost measure nothing. Variances are in the magnitude's unit squared, the error of the estimate in its unit, ages
    in seconds.
    """
    mission = trajectory.mission
    if not mission.spec.looks_again:
        return None
    trajectory = of_the_living(trajectory, losses_of(trajectory))
    seen = make_map(mission, margin_m=0.0)
    if isinstance(seen, PatrolMap):
        return {"kind": InformationKind.AGEING, **_ages(trajectory)}
    for time, position in zip(trajectory.time, trajectory.position, strict=True):
        seen.observe(float(time), position)
    assert isinstance(seen, FlightMap)
    if isinstance(seen.map, KalmanMap):
        assert isinstance(mission.spec.information, KalmanInformation)
        off = seen.map.estimate - true_field(mission)
        return {
            "kind": InformationKind.KALMAN,
            "largest_variance": float(seen.map.variance.max()),
            "mean_variance": float(seen.map.variance.mean()),
            "target_variance": mission.spec.information.target_variance,
            "rms_error": float(np.sqrt((off**2).mean())),
        }
    effective = isinstance(mission.spec.information, EffectiveInformation)
    kind = InformationKind.EFFECTIVE if effective else InformationKind.LOOKS
    return {"kind": kind, "largest_gamma": float(seen.map.residual.max())}


@dataclass(frozen=True, eq=False)
class AgeHistory:
    """The ages of looks on a patrol.

    Attributes
    ----------
    worst_s, mean_s : (T,) [s], over cells and magnitudes; from the start on where there was no look yet.
    last_s : (J, K) [s], age of each magnitude on each cell at the end.
    first_lap_s : when everything had been measured once [s], inf if never.
    limit_s : how long a look is as good as new [s].
    """

    worst_s: FloatArray
    mean_s: FloatArray
    last_s: FloatArray
    first_lap_s: float
    limit_s: float


def age_history(trajectory: Recording) -> AgeHistory:
    """Return the ages over a patrol's flight; its mission's information must be of kind ageing."""
    trajectory = of_the_living(trajectory, losses_of(trajectory))
    seen = make_map(trajectory.mission, margin_m=0.0)
    assert isinstance(seen, PatrolMap)
    worst, mean = np.empty(trajectory.time.size), np.empty(trajectory.time.size)
    for n, (time, position) in enumerate(zip(trajectory.time, trajectory.position, strict=True)):
        seen.observe(float(time), position)
        worst[n], mean[n] = seen.ages.worst_age, seen.ages.mean_age
    return AgeHistory(worst, mean, seen.ages.age, float(seen.covered_at.max()), seen.limit_s)


def _ages(trajectory: Recording) -> dict[str, Any]:
    """Return the ages over the whole run, and those after everything had been measured once.

    The mean is over cells and time, by the trapezoidal rule.
    """
    history = age_history(trajectory)
    worst, mean = history.worst_s, history.mean_s
    known = trajectory.time >= history.first_lap_s
    return {
        "worst_age_s": float(worst.max()),
        "mean_age_s": _mean(trajectory.time, mean),
        "worst_age_after_first_lap_s": float(worst[known].max()) if known.any() else None,
        "mean_age_after_first_lap_s": _mean(trajectory.time[known], mean[known]) if known.sum() > 1 else None,
        "age_limit_s": history.limit_s,
    }


def _mean(time: FloatArray, value: FloatArray) -> float:
    return float(np.trapezoid(value, time) / (time[-1] - time[0]))
