"""A fleet that moves as one body: nobody comes nearer to anyone, or gets farther away.

Where a fleet is crowded and its range short, ways that each agent flies by itself cannot be kept apart and in touch, no
QP repairs them, and the fleet rests for ever. Slow as it is, a formation keeps every distance, and brings those who can
measure to what is owed.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.motion import roll_out
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.initial_guess.guess import Guess, GuessKind, Origin
from mpc_cover.planning.task import End

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.task import Task

_NEAR = 0.8
"""Part of its sensing radius to which an agent is brought to a cell."""
_CRUISE = 0.97
"""Part of the slowest one's limits that a formation uses."""
_LOOKED_AT = 60
"""Places that are compared before each leg."""
_SPARE = 0.011
"""What is kept off the least distance to the lost [m], as plans keep it."""
_NOWHERE = 1e-12
_AT_REST = 1e-9
"""What rounding may leave of a velocity [m/s]."""
_SEEN = 0.95
"""Part of the radius within which a cell counts as measured on the way."""


class FormationFlight:
    """The fleet as one body.

    Parameters
    ----------
    budget : bounds the search for places to go to; what was found by then is flown.
    """

    def __init__(self, budget: Budget) -> None:
        self._budget = budget

    def guesses(self, task: Task, incumbent: Trajectory | None = None) -> Iterator[Guess]:  # noqa: ARG002 - from scratch
        """Yield the flight, if it leads anywhere."""
        if (motion := formation_flight(task, self._budget)) is not None:
            yield Guess(Origin(GuessKind.FORMATION, "formation"), motion=motion)


def formation_flight(task: Task, budget: Budget) -> Trajectory | None:
    """Return the motion of a fleet at rest as one body from cell to cell, to rest; None where that leads nowhere.

    Anytime: what was found within the budget.
    """
    fleet, active = task.fleet, list(task.fleet.active)
    if np.abs(task.velocity).max() > _AT_REST or task.end is not End.REST or task.start_free or not active:
        return None
    low = (fleet.motion_min - task.position[active]).max(axis=0)
    high = (fleet.motion_max - task.position[active]).min(axis=0)
    if (low > 0.0).any() or (high < 0.0).any():  # someone is outside
        return None
    speed, force = (_CRUISE * float(limit[active].min()) for limit in (fleet.speed_max, fleet.input_max))
    legs = _legs(task, (low, high), partial(_leg, speed=speed, force=force, period=task.period), budget)
    if not legs:
        return None
    common = np.concatenate([np.zeros((1, fleet.dimension)), *legs])
    velocity = np.zeros((len(common), *task.position.shape))
    velocity[:, active] = common[:, None]
    moved = _moved(common, task.period)
    position = np.repeat(task.position[None], len(common), axis=0)
    position[:, active] += moved[:, None]
    inputs = np.diff(velocity, axis=0) / task.period
    return Trajectory.even(task.start_time, task.period, position, velocity, inputs)


def _moved(velocity: FloatArray, period: float) -> FloatArray:
    """Return displacements (n, d) [m] at samples 0 to n - 1, of velocities (n, d) [m/s]."""
    return roll_out(np.zeros_like(velocity[0]), velocity[0], np.diff(velocity, axis=0) / period, period)[0]


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


def _legs(
    task: Task,
    box: tuple[FloatArray, FloatArray],
    leg: Callable[[FloatArray], FloatArray],
    budget: Budget,
) -> list[FloatArray]:
    """Return the velocities (n, d) [m/s] of each leg: again and again one that measures much in little time.

    Displacements of the fleet stay within the `box`; places to go to are those where someone is near a cell.
    """
    radius = task.fleet.radius[list(task.fleet.active)]  # (a, J)
    offset = task.cell[None] - task.position[list(task.fleet.active)][:, None]  # (a, K, d): to the cell exactly
    nearest = np.clip(offset, *box)
    within = np.linalg.norm(nearest - offset, axis=2)  # as near as the box lets them (a, K)
    reached = within[:, None] <= _SEEN * radius[:, :, None]  # (a, J, K): never where the radius is -inf
    owed, here = np.array(task.weight > 0.0), np.zeros(task.fleet.dimension)
    legs: list[FloatArray] = []

    def seen(places: FloatArray) -> BoolArray:
        """Return (P, J, K): what is owed and measured at displacements (P, d)."""
        distance = np.linalg.norm(offset - places[:, None, None], axis=3)
        return np.asarray((distance[:, :, None] <= _SEEN * radius[:, :, None]).any(axis=1) & owed)

    while (able := reached & owed).any() and not budget.exhausted:
        agent, k = np.nonzero(able.any(axis=1) & _clear(task, here, nearest))
        if not len(k):
            break
        order = np.argsort(np.linalg.norm(nearest[agent, k] - here, axis=1), kind="stable")
        agent, k = agent[order], k[order]
        first = _NEAR * float(radius[agent[0], able[agent[0], :, k[0]]].min())
        short = _stop_short(here, nearest[agent[0], k[0]], offset[agent[0], k[0]], first)
        some = np.unique(np.linspace(0, len(k) - 1, _LOOKED_AT).astype(int))
        places = np.concatenate([short[None], nearest[agent[some], k[some]]])
        gain = np.count_nonzero(seen(places), axis=(1, 2))
        took = [len(leg(place - here)) for place in places]
        goal = places[int(np.argmax(gain / took))]
        legs.append(leg(goal - here))
        passed = here + _moved(np.concatenate([np.zeros((1, len(here))), legs[-1]]), task.period)
        before = np.count_nonzero(owed)
        owed &= ~seen(passed).any(axis=0)
        if np.count_nonzero(owed) == before:  # rounding keeps it out of reach
            owed[:, k[0]] = False
        here = passed[-1]
    return legs


def _clear(task: Task, here: FloatArray, goal: FloatArray) -> BoolArray:
    """Return (...,): whether nobody comes too near to the lost on the straight way from a displacement to a goal.

    `here` (d,) [m], `goal` (..., d) [m]. Whoever is too near already comes no nearer.
    """
    fleet, active, lost = task.fleet, list(task.fleet.active), list(task.fleet.lost)
    clear = np.ones(goal.shape[:-1], dtype=bool)
    if not lost or fleet.separation_min <= 0.0:
        return clear
    between = (task.position[lost][:, None] - task.position[active]).reshape(-1, fleet.dimension)
    way = goal - here
    length = np.maximum((way**2).sum(axis=-1), _NOWHERE)
    for obstacle in between:
        least = min(fleet.separation_min + _SPARE, float(np.linalg.norm(obstacle - here)))
        part = np.clip(way @ (obstacle - here) / length, 0.0, 1.0)
        clear &= np.linalg.norm(here + part[..., None] * way - obstacle, axis=-1) >= least - _AT_REST
    return clear


def _stop_short(here: FloatArray, goal: FloatArray, cell: FloatArray, near: float) -> FloatArray:
    """Return the first place on the way that is `near` [m] to the cell, or its end."""
    part = np.linspace(0.0, 1.0, 21)[:, None]
    places = here + part * (goal - here)
    close = np.flatnonzero(np.linalg.norm(places - cell, axis=1) <= near)
    return np.asarray(places[close[0]] if close.size else goal)
