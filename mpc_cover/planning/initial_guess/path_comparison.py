"""Comparison of guesses by their paths alone, before any of them is flown: by flight time, and by the range needed."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.graph import bottleneck, fleet_trees
from mpc_cover.constraints.pairs import all_pairs
from mpc_cover.planning.initial_guess.guess import Guess, GuessKind
from mpc_cover.planning.initial_guess.path_geometry import path_length, points_along

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from mpc_cover.arrays import FloatArray
    from mpc_cover.planning.task import Task

_SHORTER_SHARE, _SHORTER_MAX = 0.93, 2
"""Part of the flight time of all other guesses below which some come before them, and how many do. Plain choices: where
others are nearly as short, refinement ends as well from them."""
_OUT_OF_RANGE_SHARE = 0.6
"""The same part for guesses that need more than the communication range: refinement has to repair them, which costs
time. Plain choice."""
_INSTANTS = 24
"""Instants at which the range is looked at; a plain choice."""


def flight_time(task: Task, guess: Guess) -> float:
    """Return the time that the paths of a guess take at full speed [s]: of the agent that arrives last."""
    return float(_flight_times(task, guess).max())


def needed_range(task: Task, guess: Guess) -> float:
    """Return the range [m] that connects the fleet all along the paths of a guess, flown at full speed."""
    times = _flight_times(task, guess)
    instant = np.linspace(0.0, float(times.max()), _INSTANTS)
    paths = zip(_approached(task, guess), task.fleet.speed_max, strict=True)
    position = np.stack([points_along(path, instant * float(speed)) for path, speed in paths], axis=1)
    one, two = all_pairs(task.fleet.size)
    distance = np.linalg.norm(position[:, one] - position[:, two], axis=2)
    return float(bottleneck(distance, fleet_trees(distance, task.fleet)).max(initial=0.0))


def shorter(task: Task, guesses: Iterable[Guess], others: Sequence[Guess]) -> tuple[list[Guess], list[Guess]]:
    """Return those of the `guesses` that are much shorter than all `others` that stay within range, at most two.

    First those within range themselves, then those that are not, as `GuessKind.SHAPE_APART`.
    """
    within = [guess for guess in others if _in_range(task, guess)]
    least = min((flight_time(task, guess) for guess in within or others), default=np.inf)
    able: list[Guess] = []
    unable: list[Guess] = []
    for guess in guesses:
        part = flight_time(task, guess) / least
        if part < _SHORTER_SHARE and _in_range(task, guess):
            able.append(guess)
        elif part < _OUT_OF_RANGE_SHARE:
            unable.append(replace(guess, origin=guess.origin._replace(kind=GuessKind.SHAPE_APART)))
    return able[:_SHORTER_MAX], unable[:_SHORTER_MAX]


def _in_range(task: Task, guess: Guess) -> bool:
    limit = task.fleet.communication_range
    return bool(np.isinf(limit)) or needed_range(task, guess) <= limit


def _approached(task: Task, guess: Guess) -> list[FloatArray]:
    """Return each agent's waypoints from where it is on, (W_i+1, d) [m]."""
    return [np.concatenate([here[None], path]) for here, path in zip(task.position, guess.paths, strict=True)]


def _flight_times(task: Task, guess: Guess) -> FloatArray:
    return np.array([path_length(path) for path in _approached(task, guess)]) / task.fleet.speed_max
