"""Towing: one agent goes to a cell, and the others follow as a rope would, for cells that no rigid formation reaches.

The leader moves a short step at a time. After each, links that are too long are pulled, pairs that are too near are
pushed apart, and all stay in the box, in a few sweeps over all of them (position-based dynamics: Mueller et al. 2007).
A step counts only if the straight leg of all agents keeps every distance; the way ends where none does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.pairs import all_pairs
from mpc_cover.model.tolerances import DIVISOR_MIN
from mpc_cover.planning.initial_guess.formation_sweeps import Formation, formation_of
from mpc_cover.planning.initial_guess.guess import Guess, GuessKind, Origin

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.task import Task

_STEP = 0.2
"""Step of the leader in sensing radii; a plain choice."""
_STEPS_MAX = 200
"""Steps to a cell; a plain choice."""
_SWEEPS = 60
"""Sweeps over all distances after a step; a plain choice."""
_RESERVE = 0.2
"""Part of the difference of range and separation by which followers keep off either; a plain choice."""
_NEAR = 0.9
"""Distance to a cell at which it counts as reached, in sensing radii; a plain choice for what lies between samples."""
_CELLS_TRIED, _LEADERS_TRIED = 5, 3
"""Cells that are tried, and agents as leaders to each, the nearest first; plain choices of a second's work at most."""
_STEP_SHARE_MIN = 0.2
"""Part of a step below which a leader that is held back gives up; a plain choice."""
_RELAXATION = 0.7
"""Part of each correction that a sweep applies, as an agent may have several; a plain choice."""


class Towing:
    """Motions in which one agent after another leads the fleet to the cells that are left."""

    def guesses(self, task: Task, incumbent: Trajectory | None = None) -> Iterator[Guess]:  # noqa: ARG002 - from scratch
        """Yield the motion to the cell that is reached first, blended, then with stops; none for fleets of one body."""
        formation = formation_of(task)
        if formation is None:
            return
        way = _way_to_a_cell(formation)
        if way is None:
            return
        for stops in (False, True):
            corners = np.array([formation.start, *way])
            motion = formation.fly(corners, range(len(corners)) if stops else ())
            yield Guess(Origin(GuessKind.FORMATION, f"towing{', stopping' * stops}"), motion=motion)


def _way_to_a_cell(formation: Formation) -> list[FloatArray] | None:
    """Return the shapes (a, d) [m] on the way to a cell, exclusive of the start; None where none is reached.

    First the fleet moves as it stands, as near as the box lets it; cells and leaders that are nearest then come first.
    """
    start = formation.start
    box = formation.room(start)
    offset = formation.cell[None] - start[:, None]  # (a, K, d)
    shift = np.clip(offset, *box)
    left = np.linalg.norm(offset - shift, axis=2)
    for k in np.argsort(left.min(axis=0), kind="stable")[:_CELLS_TRIED]:
        for leader in np.argsort(left[:, k], kind="stable")[:_LEADERS_TRIED]:
            near = start + shift[leader, k]
            way = tow(formation, near, int(leader), formation.cell[k])
            if way is not None:
                return [near, *way]
    return None


def tow(formation: Formation, shape: FloatArray, leader: int, goal: FloatArray) -> list[FloatArray] | None:
    """Return the shapes (a, d) [m] after `shape` that bring the leader near the goal (d,) [m]; None where it fails."""
    way: list[FloatArray] = []
    length = whole = _STEP * formation.sensor.radius
    aim = np.clip(goal, formation.task.fleet.motion_min, formation.task.fleet.motion_max)
    for _ in range(_STEPS_MAX):
        ahead = aim - shape[leader]
        distance = float(np.linalg.norm(ahead))
        if np.linalg.norm(shape[leader] - goal) <= _NEAR * formation.sensor.radius:
            return way
        moved = shape.copy()
        moved[leader] += ahead * min(1.0, length / max(distance, DIVISOR_MIN))
        after = _followed(formation, moved, leader)
        if formation.distances.hold([shape, after], formation.edges):
            shape, length = after, min(2.0 * length, whole)
            way.append(shape)
        elif (length := 0.5 * length) < _STEP_SHARE_MIN * whole:
            return None
    return None


def _followed(formation: Formation, shape: FloatArray, leader: int) -> FloatArray:
    """Return the shape (a, d) [m] after the others have followed the leader, which stays where it is."""
    one, two = all_pairs(len(shape))
    least, reach = formation.distances.least, formation.distances.reach
    gap = np.maximum(reach - least, 0.0)
    low, high = formation.task.fleet.motion_min, formation.task.fleet.motion_max
    shape = shape.copy()
    for _ in range(_SWEEPS):
        apart = shape[one] - shape[two]
        length = np.maximum(np.linalg.norm(apart, axis=1), DIVISOR_MIN)
        most = np.where(formation.linked, reach - _RESERVE * gap, np.inf)
        wanted = np.clip(length, least + _RESERVE * gap, most)
        wrong = wanted - length
        if not (np.abs(wrong) > DIVISOR_MIN).any():
            break
        push = 0.5 * (wrong / length)[:, None] * apart
        still_one, still_two = (one == leader)[:, None], (two == leader)[:, None]
        move = np.zeros_like(shape)
        np.add.at(move, one, np.where(still_one, 0.0, np.where(still_two, 2.0 * push, push)))
        np.add.at(move, two, np.where(still_two, 0.0, -np.where(still_one, 2.0 * push, push)))
        shape = np.clip(shape + _RELAXATION * move, low, high)
    return shape
