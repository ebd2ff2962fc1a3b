"""What a run leaves of the information that its mission asks for: looks, variances, ages."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.information.build import make_map, true_field
from mpc_cover.information.flight_map import FlightMap
from mpc_cover.information.kalman import KalmanMap
from mpc_cover.information.patrol import PatrolMap
from mpc_cover.mission.information import EffectiveInformation

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.trajectory import Trajectory


def summarise_information(trajectory: Trajectory) -> dict[str, Any] | None:
    """Return the figures of the mission's kind of information; None where a cell's first look is all.

    Variances are in the magnitude's unit squared, the error of the estimate in its unit, ages in seconds.
    """
    mission = trajectory.mission
    if not mission.spec.looks_again:
        return None
    seen = make_map(mission, margin_m=0.0)
    if isinstance(seen, PatrolMap):
        return {"kind": "ageing", **_ages(trajectory, seen)}
    for time, position in zip(trajectory.time, trajectory.position, strict=True):
        seen.observe(float(time), position)
    assert isinstance(seen, FlightMap)
    if isinstance(seen.map, KalmanMap):
        off = seen.map.estimate - true_field(mission)
        return {
            "kind": "kalman",
            "largest_variance": float(seen.map.variance.max()),
            "mean_variance": float(seen.map.variance.mean()),
            "rms_error": float(np.sqrt((off**2).mean())),
        }
    kind = "effective" if isinstance(mission.spec.information, EffectiveInformation) else "looks"
    return {"kind": kind, "largest_gamma": float(seen.map.residual.max())}


def _ages(trajectory: Trajectory, seen: PatrolMap) -> dict[str, Any]:
    """Return ages over the whole run, and from when everything had been measured once on; those from the start on.

    The mean is over cells and time, by the trapezoidal rule.
    """
    worst, mean = np.empty(trajectory.time.size), np.empty(trajectory.time.size)
    for n, (time, position) in enumerate(zip(trajectory.time, trajectory.position, strict=True)):
        seen.observe(float(time), position)
        worst[n], mean[n] = seen.ages.worst_age, seen.ages.mean_age
    known = trajectory.time >= float(seen.covered_at.max())
    return {
        "worst_age_s": float(worst.max()),
        "mean_age_s": _mean(trajectory.time, mean),
        "worst_age_after_first_lap_s": float(worst[known].max()) if known.any() else None,
        "mean_age_after_first_lap_s": _mean(trajectory.time[known], mean[known]) if known.sum() > 1 else None,
        "age_limit_s": seen.limit_s,
    }


def _mean(time: FloatArray, value: FloatArray) -> float:
    return float(np.trapezoid(value, time) / (time[-1] - time[0]))
