"""Tours of scattered cells that keep separation: agents set out one after another, or stay, where paths would conflict.

From a plan's end at rest, a greedy tour sends agents across each other's ways. Prioritised planning resolves that:
those with the longest ways set out first, each of the others as soon as it keeps clear of them; who cannot, stays.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.tolerances import AT_REST, DIVISOR_MIN
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.budget import GUESS_SAMPLE_S
from mpc_cover.planning.initial_guess.guess import Guess, GuessKind, Origin
from mpc_cover.planning.initial_guess.tour import tour_or_strips

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.model.fleet_constraints import FleetConstraints
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.task import Task

_CLEARANCE = 1.02
"""Least distance between samples, which a straight line between them approximates, in rho_B; a plain choice."""
_ROUNDING = 1e-9
"""Relative tolerance of distances; a plain choice."""
_WALL_SHARE = 0.1
"""Room that tours leave to the walls of the motion box, in steps at full speed, or of the box; a plain choice."""
_DELAYS = 12
"""Times of departure that are tried, evenly from at once to the arrival of the last agent; a plain choice."""


class StaggeredTour:
    """The greedy tour of a fleet at rest, with departures that keep separation.

    Parameters
    ----------
    budget : charged with the work.
    """

    def __init__(self, budget: Budget) -> None:
        self._budget = budget

    def guesses(self, task: Task, incumbent: Trajectory | None = None) -> Iterator[Guess]:  # noqa: ARG002 - from scratch
        """Yield the tour, if any agent can set out."""
        if np.abs(task.velocity).max() > AT_REST:
            return
        active = np.isfinite(task.fleet.radius).any(axis=1) & task.fleet.is_active
        while active.any():
            tour = tour_or_strips(replace(task, fleet=_with_radii(task, active)))
            motion = _inside(task).flown(tour, None)
            self._budget.charge(GUESS_SAMPLE_S * motion.steps)
            staggered, stays = _staggered(motion, task)
            if stays is None:
                yield Guess(Origin(GuessKind.TOUR, "tour"), motion=staggered)
                return
            active[stays] = False
            if self._budget.exhausted:
                return


def _inside(task: Task) -> Task:
    """Return the task in a motion box that is a little narrower: at full speed, tracking overshoots walls."""
    fleet = task.fleet
    room = _WALL_SHARE * float(fleet.speed_max.max()) * task.period
    room = min(room, _WALL_SHARE * float((fleet.motion_max - fleet.motion_min).min()))
    return replace(task, fleet=replace(fleet, motion_min=fleet.motion_min + room, motion_max=fleet.motion_max - room))


def _with_radii(task: Task, able: BoolArray) -> FleetConstraints:
    """Return the fleet in which only those who are `able` (m,) can measure."""
    return replace(task.fleet, radius=np.where(able[:, None], task.fleet.radius, -np.inf))


def _staggered(motion: Trajectory, task: Task) -> tuple[Trajectory, int | None]:
    """Return the motion with departures that keep separation, and None, or who has to stay as there are none such."""
    moves = np.abs(motion.velocity).max(axis=2) > AT_REST  # (N+1, m)
    arrival = np.where(moves.any(axis=0), moves.shape[0] - np.argmax(moves[::-1], axis=0), 0)
    if task.fleet.separation_min <= 0.0 or task.fleet.size == 1:
        return motion, None
    resting = [int(i) for i in np.flatnonzero(arrival == 0)]
    moving = [int(i) for i in np.argsort(-arrival, kind="stable") if arrival[i] > 0]
    delay, last = np.zeros(task.fleet.size, dtype=int), int(arrival.max())
    placed = list(resting)
    for agent in moving:
        tried = np.unique(np.linspace(0, last, _DELAYS).astype(int)).tolist()
        delay[agent] = next((late for late in tried if _is_clear(motion, task, delay, placed, agent, late)), -1)
        if delay[agent] < 0:
            return motion, agent
        placed.append(agent)
    steps = int((delay + arrival).max())
    velocity = np.zeros((steps + 1, *motion.velocity.shape[1:]))
    for agent in moving:
        velocity[delay[agent] : delay[agent] + arrival[agent], agent] = motion.velocity[: arrival[agent], agent]
    return Trajectory.from_velocities(task.position, velocity[0], velocity[1:], task.start_time, task.period), None


def _is_clear(motion: Trajectory, task: Task, delay: IntArray, placed: list[int], agent: int, late: int) -> bool:
    """Return whether an agent that sets out so many samples `late` keeps clear of all that are `placed` already."""
    if not placed:
        return True
    steps = motion.steps + late + int(delay[placed].max(initial=0))
    sample = np.arange(steps + 1)
    ours = motion.position[np.clip(sample - late, 0, motion.steps), agent]
    others = motion.position[np.clip(sample[:, None] - delay[placed], 0, motion.steps), placed]
    between = others - ours[:, None]  # (steps+1, placed, d)
    fleet = task.fleet
    stop = 0.5 * fleet.speed_max**2 / fleet.input_max if fleet.reaction_periods > 0.0 else np.zeros(fleet.size)
    rests = np.abs(motion.velocity[:, placed]).max(axis=(0, 2)) <= AT_REST
    apart = _CLEARANCE * fleet.separation_min + np.where(rests, 0.0, np.maximum(stop[agent], stop[placed]))
    least = np.minimum(apart, np.linalg.norm(between[0], axis=1))
    return bool((_closest(between) >= least * (1.0 - _ROUNDING)).all())


def _closest(between: FloatArray) -> FloatArray:
    """Return the least norm (n,) of displacements (N+1, n, d) [m] along the straight lines from sample to sample."""
    leg = np.diff(between, axis=0)
    part = -(between[:-1] * leg).sum(axis=2) / np.maximum((leg**2).sum(axis=2), DIVISOR_MIN)
    nearest = between[:-1] + np.clip(part, 0.0, 1.0)[..., None] * leg
    return np.asarray(np.linalg.norm(nearest, axis=2).min(axis=0))
