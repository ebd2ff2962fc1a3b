"""A fleet that moves as one body: nobody comes nearer to anyone, or gets farther away.

Where a fleet is crowded and its range short, ways that each agent flies by itself cannot be kept apart and in touch, no
QP repairs them, and the fleet rests for ever. Slow as it is, a convoy keeps every distance, and brings those who can
measure to what is owed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.planning.follow import Motion

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.planning.task import Task

_NEAR = 0.8
"""Part of its sensing radius to which an agent is brought to a cell."""
_CRUISE = 0.97
"""Part of the slowest one's limits that a convoy uses."""
_NOWHERE = 1e-12
_SEEN = 0.95
"""Part of the radius within which a cell counts as measured on the way."""


def convoy(task: Task) -> Motion | None:
    """Return the motion of a fleet at rest as one body from cell to cell, to rest; None where that leads nowhere."""
    fleet, active = task.fleet, list(task.fleet.active)
    if task.velocity.any() or task.end != "rest" or task.start_free or not active:
        return None
    low = (fleet.motion_min - task.position[active]).max(axis=0)
    high = (fleet.motion_max - task.position[active]).min(axis=0)
    if (low > 0.0).any() or (high < 0.0).any():  # someone is outside
        return None
    way = _way(task, low, high)
    if len(way) == 0:
        return None
    speed, force = (_CRUISE * float(limit[active].min()) for limit in (fleet.speed_max, fleet.input_max))
    legs = np.diff(np.concatenate([np.zeros_like(way[:1]), way]), axis=0)
    common = np.concatenate([np.zeros((1, way.shape[1])), *(_leg(one, speed, force, task.period) for one in legs)])
    velocity = np.zeros((len(common), *task.position.shape))
    velocity[:, active] = common[:, None]
    moved = 0.5 * task.period * np.cumsum(velocity[:-1] + velocity[1:], axis=0)
    return Motion(task.position + np.concatenate([np.zeros((1, *task.position.shape)), moved]), velocity)


def _leg(displacement: FloatArray, speed: float, force: float, period: float) -> FloatArray:
    """Return velocities (n, d) [m/s] at samples 1 to n of a straight flight from rest to rest: never past its end."""
    length, steps = float(np.linalg.norm(displacement)), 1
    while True:
        steps += 1
        sample = np.arange(1, steps)
        ramp = np.minimum(speed, force * period * np.minimum(sample, steps - sample))
        if (reach := float(period * ramp.sum())) >= length:
            size = np.append(ramp * (length / reach), 0.0)
            return np.asarray(size[:, None] * displacement / max(length, _NOWHERE))


def _way(task: Task, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return (W, d) displacements [m] of the fleet within [low, high]: again and again the nearest that shows more."""
    radius = task.fleet.radius[list(task.fleet.active)]  # (a, J)
    offset = task.cell[None] - task.position[list(task.fleet.active)][:, None]  # (a, K, d): to the cell exactly
    nearest = np.clip(offset, low, high)
    within = np.linalg.norm(nearest - offset, axis=2)  # as near as the box lets them (a, K)
    owed = np.array(task.weight > 0.0)
    reached = within[:, None] <= _SEEN * radius[:, :, None]  # (a, J, K): never where the radius is -inf
    here, found = np.zeros(task.fleet.dimension), []
    while (able := reached & owed).any():
        who = able.any(axis=1)
        ahead = np.where(who, np.linalg.norm(nearest - here, axis=2), np.inf)
        agent, k = np.unravel_index(int(np.argmin(ahead)), ahead.shape)
        goal = _stop_short(
            here, nearest[agent, k], offset[agent, k], _NEAR * float(radius[agent, able[agent, :, k]].min())
        )
        found.append(goal)
        distance = np.linalg.norm(offset - goal, axis=2)  # (a, K)
        seen = (distance[:, None] <= _SEEN * radius[:, :, None]).any(axis=0)
        seen[able[agent, :, k], k] = True
        owed &= ~seen
        here = goal
    return np.array(found)


def _stop_short(here: FloatArray, goal: FloatArray, cell: FloatArray, near: float) -> FloatArray:
    """Return the first place on the way that is `near` [m] to the cell, or its end."""
    part = np.linspace(0.0, 1.0, 21)[:, None]
    places = here + part * (goal - here)
    close = np.flatnonzero(np.linalg.norm(places - cell, axis=1) <= near)
    return np.asarray(places[close[0]] if close.size else goal)
