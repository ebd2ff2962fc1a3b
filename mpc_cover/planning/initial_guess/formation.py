"""Flight in rigid formation: the fleet moves as one body, with all distances constant.

In a crowded fleet with a short range, individual paths violate separation or connectivity, no QP repairs them, and the
fleet would rest without end. A formation is slow but keeps every distance, and it brings the agents that can measure to
the demand.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.motion import roll_out
from mpc_cover.model.tolerances import AT_REST, DIVISOR_MIN
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.initial_guess.guess import Guess, GuessKind, Origin
from mpc_cover.planning.initial_guess.waypoint_tracking import LIMIT_SHARE
from mpc_cover.planning.task import End

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.task import Task

_APPROACH_SHARE = 0.8
"""Distance at which an agent approaches a cell, in sensing radii; a plain choice."""
_APPROACH_POINTS = 21
"""Points of a leg among which the first within that distance is chosen; a plain choice."""
_PLACES = 60
"""Goals that are compared before each leg; a plain choice."""
_DISTANCE_S = 3e-8
"""Seconds that the distance of an agent to a cell takes, with all comparisons; measured on one core."""
_OBSTACLE_MARGIN = 0.011
"""Margin on rho_B to lost agents [m]: that of `ocp.Margins`, and a millimetre for rounding."""
_COVERED_SHARE = 0.95
"""Part of the sensing radius within which a cell counts as measured along a leg; a plain choice for what lies between
samples."""
_CELLS_MAX = 5000
"""Owed cells that goals are chosen by; a plain choice that bounds the time of a leg."""
_DISTANCE_ROUNDING = 1e-9
"""Tolerance of the distance to lost agents [m]; a plain choice."""


class FormationFlight:
    """Flights of the fleet as a rigid formation.

    Parameters
    ----------
    budget : of the search for goals, and charged with it; the legs found within it are flown, at least one.
    """

    def __init__(self, budget: Budget) -> None:
        self._budget = budget

    def guesses(self, task: Task, incumbent: Trajectory | None = None) -> Iterator[Guess]:  # noqa: ARG002 - from scratch
        """Yield the flight, if it measures anything."""
        if (motion := formation_flight(task, self._budget)) is not None:
            yield Guess(Origin(GuessKind.FORMATION, "formation"), motion=motion)


def formation_flight(task: Task, budget: Budget) -> Trajectory | None:
    """Return the motion of a fleet at rest as a formation from cell to cell, to rest; None if it measures nothing.

    Anytime: of the legs found within the budget, but at least one.
    """
    fleet, active = task.fleet, list(task.fleet.active)
    if np.abs(task.velocity).max() > AT_REST or task.end is not End.REST or task.start_free or not active:
        return None
    low = (fleet.motion_min - task.position[active]).max(axis=0)
    high = (fleet.motion_max - task.position[active]).min(axis=0)
    if (low > 0.0).any() or (high < 0.0).any():  # an agent is outside the box
        return None
    speed, force = (LIMIT_SHARE * float(limit[active].min()) for limit in (fleet.speed_max, fleet.input_max))
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
    """Return velocities (n, d) [m/s] at samples 1 to n of a straight flight by `displacement` [m], rest to rest."""
    length, steps = float(np.linalg.norm(displacement)), 1
    while True:
        steps += 1
        sample = np.arange(1, steps)
        ramp = np.minimum(speed, force * period * np.minimum(sample, steps - sample))
        if (reach := float(period * ramp.sum())) >= length:
            size = np.append(ramp * (length / reach), 0.0)
            return np.asarray(size[:, None] * displacement / max(length, DIVISOR_MIN))


def _legs(
    task: Task,
    box: tuple[FloatArray, FloatArray],
    leg: Callable[[FloatArray], FloatArray],
    budget: Budget,
) -> list[FloatArray]:
    """Return the velocities (n, d) [m/s] of each leg, chosen greedily by the cells measured per time.

    Displacements of the fleet stay within the `box`; goals are displacements at which an agent is near a cell.
    """
    radius = task.fleet.radius[list(task.fleet.active)]  # (a, J)
    owed = np.flatnonzero((task.weight > 0.0).any(axis=0))
    owed = owed[:: max(1, -(-len(owed) // _CELLS_MAX))]  # evenly, where there are too many to compare
    # (a, K, d): displacements to the cells
    offset = task.cell[None, owed] - task.position[list(task.fleet.active)][:, None]
    nearest = np.clip(offset, *box)
    within = np.linalg.norm(nearest - offset, axis=2)  # (a, K): distance that the box leaves
    reached = within[:, None] <= _COVERED_SHARE * radius[:, :, None]  # (a, J, K): never where the radius is -inf
    demand, here = np.array(task.weight[:, owed] > 0.0), np.zeros(task.fleet.dimension)
    legs: list[FloatArray] = []

    def covered(places: FloatArray) -> BoolArray:
        """Return (P, J, K): demand that is measured at displacements (P, d) [m]."""
        distance = np.linalg.norm(offset - places[:, None, None], axis=3)
        return np.asarray((distance[:, :, None] <= _COVERED_SHARE * radius[:, :, None]).any(axis=1) & demand)

    while (able := reached & demand).any() and not (legs and budget.exhausted):
        budget.charge(_DISTANCE_S * _PLACES * within.size)
        agent, k = np.nonzero(able.any(axis=1) & _clear(task, here, nearest))
        if not len(k):
            break
        order = np.argsort(np.linalg.norm(nearest[agent, k] - here, axis=1), kind="stable")
        agent, k = agent[order], k[order]
        near = _APPROACH_SHARE * float(radius[agent[0], able[agent[0], :, k[0]]].min())
        short = _approach_point(here, nearest[agent[0], k[0]], offset[agent[0], k[0]], near)
        some = np.unique(np.linspace(0, len(k) - 1, _PLACES).astype(int))
        places = np.concatenate([short[None], nearest[agent[some], k[some]]])
        gain = np.count_nonzero(covered(places), axis=(1, 2))
        steps = [len(leg(place - here)) for place in places]
        goal = places[int(np.argmax(gain / steps))]
        legs.append(leg(goal - here))
        passed = here + _moved(np.concatenate([np.zeros((1, len(here))), legs[-1]]), task.period)
        before = np.count_nonzero(demand)
        demand &= ~covered(passed).any(axis=0)
        if np.count_nonzero(demand) == before:  # out of reach by rounding
            demand[:, k[0]] = False
        here = passed[-1]
    return legs


def _clear(task: Task, here: FloatArray, goal: FloatArray) -> BoolArray:
    """Return (...,): whether no agent comes too near to a lost one on the straight leg from a displacement to a goal.

    `here` (d,) [m], `goal` (..., d) [m]. Agents that are too near already may come no nearer.
    """
    fleet, active, lost = task.fleet, list(task.fleet.active), list(task.fleet.lost)
    clear = np.ones(goal.shape[:-1], dtype=bool)
    if not lost or fleet.separation_min <= 0.0:
        return clear
    between = (task.position[lost][:, None] - task.position[active]).reshape(-1, fleet.dimension)
    leg = goal - here
    square = np.maximum((leg**2).sum(axis=-1), DIVISOR_MIN)
    for obstacle in between:
        least = min(fleet.separation_min + _OBSTACLE_MARGIN, float(np.linalg.norm(obstacle - here)))
        part = np.clip(leg @ (obstacle - here) / square, 0.0, 1.0)
        clear &= np.linalg.norm(here + part[..., None] * leg - obstacle, axis=-1) >= least - _DISTANCE_ROUNDING
    return clear


def _approach_point(here: FloatArray, goal: FloatArray, cell: FloatArray, near: float) -> FloatArray:
    """Return the first point (d,) of the leg within `near` [m] of the cell, or its goal."""
    part = np.linspace(0.0, 1.0, _APPROACH_POINTS)[:, None]
    places = here + part * (goal - here)
    close = np.flatnonzero(np.linalg.norm(places - cell, axis=1) <= near)
    return np.asarray(places[close[0]] if close.size else goal)
