"""Hovering: agents at rest while something is owed that they could have measured before anybody did.

An agent at rest could fly to a cell at full speed. If it would have been there before the cell was measured, then the
mission may have lost the time of its rest. An agent that waits at the end, farther from what is
left than those who measure it, does not hover.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.motion import time_from_rest
from mpc_cover.verification.losses import losses_of

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.trajectory_file import Recording

_REST_SHARE = 0.05
"""Part of its speed limit below which an agent is at rest: feedback in wind and noise moves it less. Plain choice."""
_FLIES_SHARE = 0.5
"""Part of its speed limit above which an agent is on its way, so that others may wait as relays; a plain choice."""
_TURN = 2.0
"""Turning time in units of v_max / u_max: an agent brakes, and accelerates again. Derived."""


@dataclass(frozen=True, eq=False)
class Hovering:
    """The hovering of a flight.

    Attributes
    ----------
    seconds : (m,) [s], of each agent, beyond what turning takes.
    events : how often an agent hovered.
    """

    seconds: FloatArray
    events: int


def hovering_of(trajectory: Recording) -> Hovering | None:
    """Return how long agents hovered while something was owed; None where more than a cell's first look matters.

    Each rest counts by what exceeds the time for turning. With a communication range, agents wait as relays: a cell out
    of range of everybody else counts only while nobody is on its way.
    """
    mission = trajectory.mission
    if mission.spec.looks_again:
        return None
    slow = mission.spec.disturbance.slow_agents
    speed_max = mission.fleet.speed_max * np.array([slow.get(name, 1.0) for name in mission.fleet.ids])
    period, losses = mission.spec.control.period_s, losses_of(trajectory)
    time = np.arange(float(trajectory.time[0]), float(trajectory.time[-1]), period)
    position, velocity = trajectory.at(time)
    part = np.linalg.norm(velocity, axis=2) / speed_max  # (n, m)
    waits = np.zeros(part.shape, dtype=bool)
    for n, i in np.argwhere(part < _REST_SHARE):
        if time[n] < losses.get(int(i), np.inf):
            others = _others(position[n], int(i), time[n], losses)
            anywhere = bool((part[n] > _FLIES_SHARE).any())
            waits[n, i] = _could_have(
                trajectory, int(i), time[n], position[n, i], speed_max[i], others if anywhere else None
            )
    turn = _TURN * speed_max / mission.fleet.input_max
    rests = [[(last - first) * period - turn[i] for first, last in _runs(waits[:, i])] for i in range(part.shape[1])]
    excess = [[rest for rest in each if rest > 0.0] for each in rests]
    return Hovering(np.array([sum(each) for each in excess], dtype=float), sum(len(each) for each in excess))


def _others(position: FloatArray, agent: int, time_s: float, losses: dict[int, float]) -> FloatArray:
    """Return the positions (n, d) [m] of all others that are not lost by a time [s]."""
    return position[[j for j in range(len(position)) if j != agent and time_s < losses.get(j, np.inf)]]


def _could_have(
    trajectory: Recording, agent: int, time_s: float, here: FloatArray, speed: float, others: FloatArray | None
) -> bool:
    """Return whether an agent at rest could have measured a cell that is owed before that was done.

    Of cells within communication range of `others` (n, d) [m], or of all where None.
    """
    fleet, force = trajectory.mission.fleet, float(trajectory.mission.fleet.input_max[agent])
    radius = float(fleet.radius[agent].max())
    left = np.flatnonzero(trajectory.covered_at > time_s)
    if not left.size or not np.isfinite(radius):
        return False
    cell = trajectory.cell[left]
    free = _measurable(cell, fleet, radius)
    if others is not None and np.isfinite(fleet.communication_range):
        between = np.linalg.norm(cell[:, None] - others[None], axis=2)
        free &= (between <= fleet.communication_range + radius).any(axis=1)
    distance = np.maximum(np.linalg.norm(cell - here, axis=1) - radius, 0.0)
    arrival = time_from_rest(distance, speed, force)
    done = np.minimum(trajectory.covered_at[left], trajectory.time[-1])
    return bool((free & (time_s + arrival < done)).any())


def _measurable(cell: FloatArray, fleet: Fleet, radius: float) -> BoolArray:
    """Return (K,): whether the motion box comes within a radius [m] of each of the (K, d) cells [m]."""
    nearest = np.clip(cell, fleet.motion_min, fleet.motion_max)
    return np.asarray(np.linalg.norm(nearest - cell, axis=1) <= radius)


def _runs(true: BoolArray) -> list[tuple[int, int]]:
    """Return the first index and that after the last of each run of True in (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]]).astype(int)))
    return list(pairwise(edges.tolist()))[::2]
