"""Replays a recorded motion into the map that its mission asks for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.information.build import make_map
from mpc_cover.model.look_instants import measures_on_the_way
from mpc_cover.model.sensing import covered_at, passed_at

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.information.demand import FlownMap
    from mpc_cover.mission.load import Mission


def replayed(mission: Mission, time: FloatArray, position: FloatArray) -> FlownMap:
    """Return the map after a fleet's true positions (T, m, d) [m] at the times (T,) [s]."""
    seen = make_map(mission, margin_m=0.0)
    for instant, now in zip(time, position, strict=True):
        seen.observe(float(instant), now)
    return seen


def measured_at(
    mission: Mission, time: FloatArray, position: FloatArray, velocity: FloatArray | None = None
) -> FloatArray:
    """Return (K,) [s]: the first of the (T,) times by which nothing was owed any more on each cell; inf where never.

    Continuous sensing measures between them, too, if `velocity` (T, m, d) [m/s] is given; inputs are constant there.
    """
    if measures_on_the_way(mission) and velocity is not None:
        return passed_at(time, position, velocity, mission.field.cell, mission.fleet.radius)
    if not mission.spec.looks_again:
        return covered_at(time, position, mission.field.cell, mission.fleet.radius)
    return np.asarray(replayed(mission, time, position).covered_at)
