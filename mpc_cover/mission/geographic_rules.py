"""Recognises degrees that were given as metres: nothing else would tell, and every figure would be nonsense."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.errors import Problem
from mpc_cover.mission.field import bounding_box
from mpc_cover.mission.fleet import agent_value

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.mission.config import MissionSpec

_DEGREES = 180.0
_ALONE = 10.0
"""Degrees of a site are this many times its extent from zero at least; so is hardly a box in metres. A plain choice."""
_TINY = 0.1
"""Parts of a sensing radius that a site in degrees measures at most: one of 1 km and a radius of 1 m give 0.01."""

_RIGHT = (
    "these look like degrees of longitude and latitude, but coordinates are metres: project them first, to UTM or to a "
    "plane at a point (lon0, lat0): x = 111320 cos(lat0) (lon - lon0), y = 110540 (lat - lat0); in metres from a "
    "corner of W, these very numbers are accepted"
)


def geographic_problems(spec: MissionSpec) -> Iterator[Problem]:
    """Yield a problem where W is as far from zero as degrees are, and a speck beside what agents see or fly.

    A speck is less than a tenth of the smallest sensing radius, or crossed within a control period.
    """
    lower, upper = bounding_box(spec.area.shape)
    extent = float(np.linalg.norm(upper[:2] - lower[:2]))
    away = np.abs(np.stack([lower[:2], upper[:2]]))
    if away.max() > _DEGREES or away.min(axis=0).max() < _ALONE * extent:
        return
    radii, speeds = [], []
    for agent in spec.fleet.agents:
        given = agent_value(spec, agent, "sensing_radius_m")
        radii += list(given.values()) if isinstance(given, dict) else [given] if isinstance(given, float) else []
        if isinstance(speed := agent_value(spec, agent, "speed_max_m_per_s"), float):
            speeds.append(speed)
    seen_at_once = bool(radii) and extent < _TINY * min(radii)
    crossed_at_once = bool(speeds) and extent < min(speeds) * spec.control.period_s
    if seen_at_once or crossed_at_once:
        place = f"{extent:.3g} m across at ({', '.join(f'{x:.6g}' for x in lower)})"
        yield Problem("area.shape", place, _RIGHT)
