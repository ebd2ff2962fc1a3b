"""Transformations of missions as raw data under which a controller should fly the same: its invariances."""

from __future__ import annotations

import copy
import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mpc_cover.arrays import FloatArray

Raw = dict[str, Any]
"""A mission as it is read from YAML."""

_POWERS = {"_m": 1, "_m_per_s": 1, "_m_per_s2": 1, "_m2_per_s": 2}
"""Powers of a length by the endings of names."""


def moved(raw: Raw, offset: Sequence[float]) -> Raw:
    """Return the mission with all points moved by `offset` (d,) [m]."""
    return _mapped(raw, lambda point: point + np.asarray(offset))


def rotated(raw: Raw, angle: float) -> Raw:
    """Return the planar mission turned about the origin by an angle [rad]; its shape must be a polygon or a disc."""
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    return _mapped(raw, lambda point: turn @ point)


def scaled(raw: Raw, factor: float) -> Raw:
    """Return the mission with all lengths, speeds and accelerations times `factor`: it takes the same time."""
    return {key: _scaled(value, factor, _power(key)) for key, value in raw.items()}


def renumbered(raw: Raw, order: Sequence[int]) -> Raw:
    """Return the mission with its agents in another order; their names stay in place."""
    changed = copy.deepcopy(raw)
    agents = changed["fleet"]["agents"]
    changed["fleet"]["agents"] = [{**agents[old], "id": agents[new]["id"]} for new, old in enumerate(order)]
    return changed


def with_period(raw: Raw, period_s: float) -> Raw:
    """Return the mission with another control period [s], and a horizon that lasts as long."""
    changed = copy.deepcopy(raw)
    control = changed["control"]
    lasts = control["horizon_steps"] * control["period_s"]
    control["period_s"], control["horizon_steps"] = period_s, math.ceil(lasts / period_s - 1e-9)
    return changed


def _mapped(raw: Raw, move: Callable[[FloatArray], FloatArray]) -> Raw:
    """Return the mission with all its points moved."""

    def point(given: Sequence[float]) -> list[float]:
        return [float(value) for value in move(np.asarray(given, dtype=float))]

    changed = copy.deepcopy(raw)
    shape, area = changed["area"]["shape"], changed["area"]
    for owner, key in ((shape, "min_m"), (shape, "max_m"), (shape, "center_m"), (area, "motion_min_m")):
        if key in owner:
            owner[key] = point(owner[key])
    if "motion_max_m" in area:
        area["motion_max_m"] = point(area["motion_max_m"])
    if "outline_m" in shape:
        shape["outline_m"] = [point(corner) for corner in shape["outline_m"]]
        shape["holes_m"] = [[point(corner) for corner in hole] for hole in shape.get("holes_m", ())]
    for agent in changed["fleet"]["agents"]:
        for key in ("start_m", "end_m"):
            if key in agent:
                agent[key] = point(agent[key])
    return changed


def _scaled(value: Any, factor: float, power: int) -> Any:
    """Return plain data times a power of the factor; the names within it have powers of their own."""
    match value:
        case dict():
            return {key: _scaled(item, factor, power or _power(str(key))) for key, item in value.items()}
        case list() | tuple():
            return [_scaled(item, factor, power) for item in value]
        case int() | float() if power and not isinstance(value, bool):
            return value * factor**power
        case _:
            return value


def _power(name: str) -> int:
    return next((power for ending, power in _POWERS.items() if name.endswith(ending)), 0)
