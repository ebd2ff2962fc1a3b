"""Random starts of a fleet: separated, connected, and the same for a seed whatever the controller."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.errors import UserError
from mpc_cover.model.tube import tube_of

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.mission.load import Mission

_STREAM = 0x57A7
"""Keeps these draws apart from other uses of the same seed."""
_PROPOSALS = 200
"""Places proposed for an agent before all are drawn anew."""
_ATTEMPTS = 50
_ROOM = 0.02
"""Part of the gap between rho_B and rho_C that starts keep from either."""


class Starts(StrEnum):
    """Where a fleet starts."""

    RANDOM = "random"
    """Drawn for each seed."""
    MISSION = "mission"
    """As the mission says."""


def random_starts(mission: Mission, seed: int) -> FloatArray:
    """Return (m, d) starts [m] in the motion box, at least rho_B apart, connected within rho_C, links included.

    Where the mission is disturbed, these bounds are tightened by the tube around plans (`model.tube`).

    Rejection sampling, agent by agent: the first is uniform in the box; each other one is uniform in the part
    of the box within rho_C of an agent drawn from those placed (a cube about it), and is proposed again until it
    is far enough from all agents placed and near enough to one of them. If an agent finds no place, all are drawn
    anew.

    Raises
    ------
    UserError
        The box has no room for the fleet, or too little to be found.
    """
    fleet = _with_room(mission)
    rng = np.random.default_rng((seed, _STREAM))
    for _ in range(_ATTEMPTS):
        placed = np.empty((0, fleet.dimension))
        while len(placed) < fleet.size and (place := _find_place(fleet, placed, rng)) is not None:
            placed = np.concatenate([placed, place[None]])
        if len(placed) == fleet.size:
            return placed
    apart = f"{fleet.separation_min:g} m apart"
    near = f" and connected within {fleet.communication_range:g} m" if np.isfinite(fleet.communication_range) else ""
    raise UserError(
        f"--starts random: found no starts for {fleet.size} agents {apart}{near} "
        f"between {fleet.motion_min.tolist()} and {fleet.motion_max.tolist()}: give them more room, or --starts mission"
    )


def _with_room(mission: Mission) -> Fleet:
    """Return the fleet with its bounds tightened by the tube, whatever its own starts."""
    fleet, radius = mission.fleet, tube_of(mission).position_m
    return replace(
        fleet,
        separation_min=fleet.separation_min + 2.0 * radius if fleet.separation_min > 0.0 else 0.0,
        communication_range=fleet.communication_range - 2.0 * radius,
        motion_min=fleet.motion_min + radius,
        motion_max=fleet.motion_max - radius,
    )


def _find_place(fleet: Fleet, placed: FloatArray, rng: np.random.Generator) -> FloatArray | None:
    """Return a place (d,) for the next agent, or None if no proposal is valid."""
    agent = len(placed)
    linked = [min(pair) for pair in fleet.links if max(pair) == agent]
    near = linked or list(range(agent))
    if (fleet.motion_min > fleet.motion_max).any():
        return None
    for _ in range(_PROPOSALS):
        low, high = fleet.motion_min, fleet.motion_max
        if near and np.isfinite(fleet.communication_range):
            centre = placed[near[int(rng.integers(len(near)))]]
            low = np.maximum(low, centre - fleet.communication_range)
            high = np.minimum(high, centre + fleet.communication_range)
        place = rng.uniform(low, high)
        if _fits(fleet, placed, place, linked):
            return place
    return None


def _fits(fleet: Fleet, placed: FloatArray, place: FloatArray, linked: list[int]) -> bool:
    if len(placed) == 0:
        return True
    least, reach = fleet.separation_min, fleet.communication_range
    room = _ROOM * (reach - least if np.isfinite(reach) else least)
    distance = np.linalg.norm(placed - place, axis=1)
    near = distance <= reach - room
    return bool((distance >= least + room).all() and near.any() and near[linked].all())
